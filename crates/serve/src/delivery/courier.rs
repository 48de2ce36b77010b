//! The courier of a stream: one task that hands each of its messages on to every reader.
//!
//! It is all of a stream that the thread with the frames ever wakes, however many read it: to wake a task of another
//! thread takes a lock, and memory where many are woken at once.

use super::lane::Lane;
use super::message::Message;
use super::second_hand::Hands;
use crate::delivery::Delivery;
use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;

/// The lanes that a stream's messages are handed on to.
#[derive(Debug, Default)]
pub(crate) struct Readers {
    /// Those that the courier sends the newest message.
    offered: RefCell<Vec<Rc<Lane>>>,
    /// Those whose own tasks it wakes for what they are to send.
    woken: RefCell<Vec<Rc<Lane>>>,
    /// Whether there is a courier.
    is_delivered: Cell<bool>,
}

impl Readers {
    fn of(&self, delivery: Delivery) -> &RefCell<Vec<Rc<Lane>>> {
        match delivery {
            Delivery::NewestByCourier => &self.offered,
            Delivery::Newest | Delivery::Every => &self.woken,
        }
    }

    /// Messages are handed on to another lane from now on. Returns whether the caller has to start a courier.
    pub(crate) fn join(&self, lane: &Rc<Lane>, delivery: Delivery) -> bool {
        self.of(delivery).borrow_mut().push(lane.clone());
        !self.is_delivered.replace(true)
    }

    /// A lane that called [`Readers::join`] is gone.
    pub(crate) fn leave(&self, lane: &Rc<Lane>, delivery: Delivery) {
        let mut lanes = self.of(delivery).borrow_mut();
        if let Some(at) = lanes.iter().position(|other| Rc::ptr_eq(other, lane)) {
            lanes.swap_remove(at);
        }
    }

    /// Hands a message on; says whether there is anybody to hand the next one to.
    pub(crate) fn hand_on(&self, message: &Arc<Message>, hands: &Hands) -> bool {
        let (offered, woken) = (self.offered.borrow(), self.woken.borrow());
        hands.send(message, &offered);
        woken.iter().for_each(|lane| lane.call(message));
        let are_there = !offered.is_empty() || !woken.is_empty();
        self.is_delivered.set(are_there);
        are_there
    }
}
