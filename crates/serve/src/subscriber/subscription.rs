//! What a subscriber wants, and what becomes of that: its profile first, then the rest.

use super::Subscriber;
use crate::delivery::Delivery;
use crate::farewell::Farewell;
use crate::profiles::active_profile::{ActiveProfile, Lease};
use crate::profiles::profile_maker::{DisplayProfile, ProfileMaker};
use std::rc::Rc;
use taxel_wire::{Event, EventKind, Subscribe, SubscribeError};
use tokio::task::JoinHandle;

/// Subscriptions in a row that a client may have refused before it is disconnected.
const MAX_REFUSALS: u32 = 8;

/// A subscription that waits for its profile.
pub(super) struct Asked {
    wants: Subscribe,
    /// Whether the client asked; otherwise the profile of whoever states none has changed, of which
    /// it is shown a region.
    by_client: bool,
    lease: JoinHandle<Result<Lease, String>>,
}

impl Drop for Asked {
    /// Who is gone must not be in the way of those that ask now.
    fn drop(&mut self) {
        self.lease.abort();
    }
}

impl<M: ProfileMaker> Subscriber<'_, M> {
    /// Takes a subscription; tells the client what is wrong with one that is refused.
    pub(super) async fn handle_packet(&mut self, packet: &[u8]) -> Result<(), Farewell> {
        match Subscribe::from_packet(packet) {
            Ok(wants) => self.ask(wants, true).await,
            Err(
                error @ (SubscribeError::TooLong { .. }
                | SubscribeError::Decode(_)
                | SubscribeError::WrongKind { .. }),
            ) => Err(Farewell::Nonsense(error)),
            Err(error) => self.refuse(error.to_string()).await,
        }
    }

    /// Puts a subscription into effect, or asks for its profile first.
    async fn ask(&mut self, wants: Subscribe, by_client: bool) -> Result<(), Farewell> {
        let region = match self.server.profiles.region(wants.region.as_deref()) {
            Ok(region) => region,
            Err(reason) => return self.refuse(reason).await,
        };
        // Kept as the hand has it, however often the client names a part.
        let wants = Subscribe {
            region: region.clone(),
            ..wants
        };
        if wants.profile.is_none() && region.is_none() {
            let own = self.own.borrow_and_update().clone();
            if let Err(reason) = self.subscribe(wants)? {
                return self.refuse(reason).await;
            }
            self.give_up_lease();
            return self.show(own).await;
        }
        let profile = wants.profile.clone();
        let wanted = DisplayProfile {
            profile: profile.unwrap_or_else(|| self.own.borrow_and_update().wanted.profile.clone()),
            region,
        };
        let server = self.server.clone();
        let instead_of = self.lease.as_ref().map(|lease| lease.profile().clone());
        let entry = self.entry.clone();
        let lease = tokio::task::spawn_local(async move {
            let profiles = &server.profiles;
            let lease = profiles.lease(wanted.clone(), instead_of.clone()).await;
            if lease.is_ok() || !entry.is_guest() {
                return lease;
            }
            // Whoever leaves for it may have the profile that is one too many.
            entry.settled().await;
            profiles.lease(wanted, instead_of).await
        });
        self.asked = Some(Asked {
            wants,
            by_client,
            lease,
        });
        Ok(())
    }

    /// Puts the subscription that was asked for into effect, now that its profile is there; or says why not.
    pub(super) async fn handle_answer(&mut self, answer: Result<Lease, String>) -> Result<(), Farewell> {
        let Some(asked) = self.asked.take() else {
            return Ok(());
        };
        match answer {
            Ok(lease) => {
                let shown = lease.profile().clone();
                if let Err(reason) = self.subscribe(asked.wants.clone())? {
                    return self.refuse(reason).await;
                }
                self.give_up_lease();
                self.lease = Some(lease);
                self.show(shown).await
            }
            Err(reason) if asked.by_client => self.refuse(reason).await,
            // It goes on with what it is shown, and is not to blame.
            Err(reason) => self.send_event(&Event::new(EventKind::Refused, reason)).await,
        }
    }

    /// Goes on with the profile of whoever states none after that has changed.
    pub(super) async fn follow(&mut self) -> Result<(), Farewell> {
        if self.wants.region.is_some() {
            return self.ask(self.wants.clone(), false).await;
        }
        let own = self.own.borrow_and_update().clone();
        self.show(own).await
    }

    /// Takes what is wanted but for the profile. The inner error says why it cannot be had, and
    /// nothing has changed then.
    fn subscribe(&mut self, wants: Subscribe) -> Result<Result<(), String>, Farewell> {
        let raw_delivery = Delivery::of_raw_frames(&wants);
        if !wants.raw {
            self.end_raw();
        } else if self.raw.as_ref().is_none_or(|raw| raw.delivery() != raw_delivery) {
            let profiles = &self.server.profiles;
            match self.server.raw.open(&profiles.maker, &profiles.slots) {
                Ok(stream) => {
                    if self.raw.is_none() {
                        self.raw_lane.begin(stream.newest_tick().max(self.newest_tick()));
                    }
                    self.raw = Some(self.server.feed(&stream, &self.raw_lane, raw_delivery));
                }
                Err(reason) => return Ok(Err(reason)),
            }
        }
        let image_delivery = Delivery::of_images(&wants);
        if wants.image != self.wants.image || self.images.delivery() != image_delivery {
            self.images = self
                .server
                .feed(&self.shown.stream, &self.image_lane, image_delivery);
        }
        match (self.wants.image, wants.image) {
            (true, false) => self.image_lane.end(self.newest_tick()),
            (false, true) => self.image_lane.begin(self.newest_tick()),
            // What it asks for now may be the first that it asked for at all.
            (true, true) if self.image_lane.is_untouched() => self.image_lane.begin(self.newest_tick()),
            _ => {}
        }
        if wants.status && !self.wants.status {
            self.status.mark_unchanged();
        }
        self.entry.set_wants(&wants);
        for lane in [&self.image_lane, &self.raw_lane] {
            lane.limit_rate(wants.max_rate_hz);
        }
        self.wants = wants;
        self.refusals = 0;
        self.size_send_buffer()?;
        Ok(Ok(()))
    }

    fn give_up_lease(&mut self) {
        if let Some(lease) = self.lease.take() {
            self.server.profiles.give_up(lease);
        }
    }

    /// Shows a profile, and says so. Ticks go on being counted across a change.
    async fn show(&mut self, shown: Rc<ActiveProfile>) -> Result<(), Farewell> {
        if !Rc::ptr_eq(&shown, &self.shown) {
            self.images = self
                .server
                .feed(&shown.stream, &self.image_lane, self.images.delivery());
            self.image_lane.limit_rate(self.wants.max_rate_hz);
            self.entry.set_profile(shown.id);
            self.shown = shown;
            if self.wants.image && self.image_lane.is_untouched() {
                self.image_lane.begin(self.newest_tick());
            }
            self.size_send_buffer()?;
        }
        self.send_hello().await
    }

    async fn refuse(&mut self, reason: String) -> Result<(), Farewell> {
        if self.refusals >= MAX_REFUSALS {
            return Err(Farewell::Insists(reason));
        }
        self.refusals += 1;
        self.send_event(&Event::new(EventKind::Refused, reason)).await
    }
}

/// What became of the profile that was asked for.
pub(super) async fn answer(asked: &mut Option<Asked>) -> Result<Lease, String> {
    match asked {
        Some(asked) => (&mut asked.lease).await.unwrap_or_else(|e| Err(e.to_string())),
        None => std::future::pending().await,
    }
}
