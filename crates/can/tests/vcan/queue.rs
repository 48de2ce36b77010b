//! What the kernel queues, drops, counts and filters.

use super::*;
use taxel_can::{CanFrame, CanSource, IdFilter, LinkState, SocketCan, SocketCanOptions};

#[test]
fn a_loss_is_noticed_even_when_a_send_took_the_kernels_word_of_it() {
    if !vcan_is_here("loss noticed by a send") {
        return;
    }
    let vcan = Vcan::up("tx_sendloss");
    let mut source = open("tx_sendloss");
    receive_until(&mut source, "link", |s, _| s.link() == LinkState::Up);
    vcan.set("down");
    assert!(source.send(&frame(1)).is_err());
    wait_for_link(&mut source, LinkState::Down);
    vcan.delete();
    assert!(source.send(&frame(1)).is_err());
    wait_for_link(&mut source, LinkState::Absent);
    assert_eq!((source.counters().link_losses, source.counters().reopens), (1, 0));
}

#[test]
fn a_burst_far_over_the_kernels_default_queue_is_received_whole() {
    if !vcan_is_here("burst") {
        return;
    }
    let _vcan = Vcan::up("tx_burst");
    let (mut source, mut peer) = (open("tx_burst"), open("tx_burst"));
    // The kernel's default queue of 212992 bytes holds 278 frames.
    for n in 0..8000 {
        peer.send(&frame(n)).unwrap();
    }
    assert_eq!(
        numbers(&receive_count(&mut source, 8000)),
        (0..8000).collect::<Vec<_>>()
    );
    assert_eq!(source.counters().lost_in_kernel, 0);
    assert!(source.receive_buffer() >= 4 << 20);
}

#[test]
fn frames_the_kernel_drops_while_nobody_reads_are_all_counted() {
    if !vcan_is_here("kernel drops") {
        return;
    }
    let _vcan = Vcan::up("tx_drops");
    let options = SocketCanOptions {
        receive_buffer: 16 * 1024,
        ..SocketCanOptions::default()
    };
    let mut source = SocketCan::open("tx_drops", options).unwrap();
    let mut peer = open("tx_drops");
    for round in 1..=3 {
        for n in 0..1000 {
            peer.send(&frame(n)).unwrap();
        }
        // No further frame comes that could carry the news: the source has to ask the kernel by itself.
        receive_until(&mut source, "end of the accounts", |s, _| {
            s.counters().received + s.counters().lost_in_kernel == round * 1000
        });
        assert!(source.counters().lost_in_kernel >= round * 500);
    }
    // And one that carries it does not count it twice.
    peer.send(&frame(1)).unwrap();
    receive_count(&mut source, 1);
    assert_eq!(
        source.counters().received + source.counters().lost_in_kernel,
        3001
    );
}

#[test]
fn filters_let_through_what_they_name_and_all_error_frames() {
    if !vcan_is_here("filters") {
        return;
    }
    let _vcan = Vcan::up("tx_filter");
    let options = SocketCanOptions {
        filters: vec![
            IdFilter::standard(0x120, 0x7F0),
            IdFilter::extended(0x55, 0x1FFF_FFFF),
        ],
        ..SocketCanOptions::default()
    };
    let mut source = SocketCan::open("tx_filter", options.clone()).unwrap();
    let mut peer = open("tx_filter");
    let mut expected = Vec::new();
    for id in 0..0x200 {
        let sent = [
            CanFrame::standard(id, &[]).unwrap(),
            CanFrame::extended(id.into(), &[]).unwrap(),
        ];
        for frame in sent {
            peer.send(&frame).unwrap();
            if options.filters.iter().any(|f| f.passes(&frame)) {
                expected.push(frame);
            }
        }
    }
    let last = CanFrame::error(0x2, [0; 8]);
    peer.send(&last).unwrap();
    expected.push(last);
    assert_eq!(expected.len(), 16 + 1 + 1);
    let received = receive_until(&mut source, "last frame", |_, all| {
        all.last().is_some_and(|r| r.frame == last)
    });
    assert_eq!(received.iter().map(|r| r.frame).collect::<Vec<_>>(), expected);
}
