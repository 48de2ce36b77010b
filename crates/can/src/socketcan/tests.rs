use super::*;

#[test]
fn a_kernel_frame_is_read_and_written_byte_for_byte() {
    let cases: [(CanFrame, u32, [u8; 12]); 4] = [
        (
            CanFrame::standard(0x20B, &[7, 0]).unwrap(),
            0x20B,
            [2, 0, 0, 0, 7, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            CanFrame::extended(0x123, &[1, 2, 3, 4, 5, 6, 7, 8]).unwrap(),
            0x8000_0123,
            [8, 0, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8],
        ),
        (
            CanFrame::remote(0x123, false, 4).unwrap(),
            0x4000_0123,
            [4, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0],
        ),
        (
            CanFrame::error(0x240, [0, 0, 0, 0, 0, 0, 9, 8]),
            0x2000_0240,
            [8, 0, 0, 0, 0, 0, 0, 0, 0, 0, 9, 8],
        ),
    ];
    for (frame, id, rest) in cases {
        let bytes = [&id.to_ne_bytes()[..], &rest].concat();
        assert_eq!(decode(&bytes), Some(frame));
        assert_eq!(encode(&frame)[..], bytes);
    }
}

#[test]
fn what_is_no_classic_frame_is_refused() {
    assert_eq!(decode(&[0; 15]), None);
    assert_eq!(decode(&[0; 72]), None);
    let mut over_long = [0; 16];
    over_long[4] = 9;
    assert_eq!(decode(&over_long), None);
}

#[test]
fn a_process_out_of_file_descriptors_does_not_lose_its_interface() {
    for (looked_up, another) in [
        (Ok(3), false),
        (Ok(4), true),
        (Err(Errno::ENODEV), true),
        (Err(Errno::ENXIO), true),
        (Err(Errno::EMFILE), false),
        (Err(Errno::ENFILE), false),
        (Err(Errno::ENOMEM), false),
    ] {
        assert_eq!(is_another(looked_up, 3), another, "{looked_up:?}");
    }
}

#[test]
fn an_error_that_stays_does_not_hold_up_who_reads() {
    let (no_socket, _writer) = io::pipe().unwrap();
    let mut source = SocketCan {
        interface: "can0".into(),
        options: SocketCanOptions::default(),
        filters: Vec::new(),
        open: Some(Open {
            socket: CanSocket::from(std::os::fd::OwnedFd::from(no_socket)),
            ifindex: 1,
            stamps: StampConverter::starting_now(),
            drops: DropCounter::default(),
            is_dead: false,
            without_carrier: 0,
        }),
        reader: DatagramReader::new(),
        link: LinkState::Up,
        counters: SourceCounters::default(),
        was_open: true,
        receive_buffer: 0,
        next_check_ns: u64::MAX,
        back_off_ns: 0,
    };
    let mut batch = Vec::with_capacity(8);
    assert!(!source.drain(1, &mut batch));
    assert!(batch.is_empty() && source.open.unwrap().is_dead);
}

#[test]
fn impossible_names_and_too_many_filters_are_refused_before_any_socket_is_opened() {
    let refused = |name, options| SocketCan::open(name, options).err().unwrap().to_string();
    assert!(refused("", SocketCanOptions::default()).contains("no interface name"));
    assert!(refused("can 0", SocketCanOptions::default()).contains("no interface name"));
    let filters = vec![IdFilter::standard(0, 0); 513];
    let options = SocketCanOptions {
        filters,
        ..Default::default()
    };
    assert!(refused("can0", options).contains("513"));
}

#[test]
fn a_kernel_without_can_says_what_to_do_and_one_with_it_waits_for_the_interface() {
    match SocketCan::open("no-such-can", SocketCanOptions::default()) {
        Ok(source) => assert_eq!(source.link(), LinkState::Absent),
        Err(e @ OpenError::NotSupported { .. }) => {
            let text = e.to_string();
            assert!(text.contains("modprobe") && text.contains("udp:"), "{text}");
        }
        Err(e) => panic!("{e}"),
    }
}
