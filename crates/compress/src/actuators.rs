//! Actuator quantisation, eqs (8) to (12): where the display presses, and how hard.

use taxel_cluster::{Kmeans2d, Kmeans2dSettings, Plane, lloyd2d, maximin, medoids};
use taxel_hand::{Actuator, ActuatorForce, Geometry, Placement, Profile, ProfileError};

use crate::actuator_groups;
use crate::contacts::Contacts;
use crate::fixed::Fixed;
use crate::heights::Heights;
use crate::levels::Levels;

/// The actuator stage and its memory.
#[derive(Debug)]
pub(crate) struct Actuators {
    x: Vec<f64>,
    y: Vec<f64>,
    cluster: Vec<u16>,
    sums: Vec<[f64; 3]>,
    least: Vec<f64>,
    member: Vec<Option<u32>>,
    nearest: Vec<f64>,
    pressing: Vec<Pressing>,
    /// Level that each id pressed with in the last frame, from 1; 0 where it did not.
    held: Vec<u16>,
    /// Parts of the hand that share a number of actuators.
    groups: Vec<Group>,
    group_of_part: Vec<usize>,
    /// First coordinates, moved apart by part of the hand.
    apart: Vec<f64>,
    /// Forces in the unit of the coordinates.
    heights: Heights,
    /// Distance of neighbouring taxels.
    pitch: f64,
    fixed: Option<Fixed>,
}

/// Actuators for some parts of the hand, which follow contacts there.
#[derive(Debug)]
struct Group {
    first_id: u16,
    follower: Kmeans2d,
    /// The contacts of these parts: their numbers, places, keys and forces.
    contact: Vec<u32>,
    x: Vec<f64>,
    y: Vec<f64>,
    key: Vec<u16>,
    force: Vec<f64>,
    height: Vec<f64>,
}

impl Group {
    fn new(first_id: u16, clusters: u16, taxels: usize, settings: Kmeans2dSettings) -> Self {
        Self {
            first_id,
            follower: Kmeans2d::new(taxels, clusters.into(), settings),
            contact: Vec::with_capacity(taxels),
            x: Vec::with_capacity(taxels),
            y: Vec::with_capacity(taxels),
            key: Vec::with_capacity(taxels),
            force: Vec::with_capacity(taxels),
            height: Vec::with_capacity(taxels),
        }
    }
}

/// How far columns of different parts of the hand are moved apart, pixels or millimetres: an
/// actuator in between would be worth nothing.
const PART_DISTANCE: f64 = 4096.0;

/// What presses on an actuator.
#[derive(Debug, Default, Clone, Copy)]
struct Pressing {
    highest: u16,
    sum: f64,
    count: u32,
}

impl Actuators {
    /// Memory for every taxel of the geometry.
    pub(crate) fn new(
        profile: &Profile,
        geometry: &Geometry,
        places: &[[f64; 2]],
        contacts: &Contacts,
    ) -> Result<Self, ProfileError> {
        let taxels = geometry.taxels.len();
        let most = usize::from(profile.actuators);
        let settings = Kmeans2dSettings {
            history: profile.history,
            swap_gain: profile.jump_gain,
            swaps: 4,
            iterations: 6,
            reach: actuator_groups::reach(geometry, profile.coordinates),
        };
        let (sizes, group_of_part) = actuator_groups::groups(geometry, profile)?;
        let mut first_id = 0;
        let mut groups = Vec::new();
        for size in sizes {
            groups.push(Group::new(first_id, size, taxels, settings));
            first_id += size;
        }
        actuator_groups::check_fixed(geometry, profile, places, settings.reach)?;
        let fixed = (!profile.fixed.is_empty())
            .then(|| Fixed::new(&profile.fixed, geometry, places, &contacts.raster()));
        Ok(Self {
            x: vec![0.0; most],
            y: vec![0.0; most],
            cluster: Vec::with_capacity(taxels),
            sums: vec![[0.0; 3]; most],
            least: vec![0.0; most],
            member: vec![None; most],
            nearest: Vec::with_capacity(taxels),
            pressing: vec![Pressing::default(); most],
            held: vec![0; most],
            groups,
            group_of_part,
            apart: Vec::with_capacity(taxels),
            heights: Heights::new(geometry, &contacts.raster()),
            pitch: 0.5 * settings.reach,
            fixed,
        })
    }

    /// Places the actuators of a frame and says how hard each presses.
    pub(crate) fn place(
        &mut self,
        profile: &Profile,
        contacts: &Contacts,
        levels: &Levels,
        out: &mut Vec<Actuator>,
    ) {
        if let Some(fixed) = &mut self.fixed {
            fixed.assign(contacts, &mut self.cluster);
            self.member.fill(None);
            for (n, id) in self.cluster.iter().enumerate() {
                self.member[usize::from(*id)] = Some(n as u32);
            }
            self.press(profile, contacts, levels, out);
            return;
        }
        match profile.placement() {
            Placement::Lloyd => self.lloyd(profile, contacts, levels, out),
            Placement::Follow => self.follow(profile, contacts, levels, out),
        }
    }

    /// Number of the cluster each contact belongs to: the id of its actuator.
    pub(crate) fn cluster(&self) -> &[u16] {
        &self.cluster
    }

    /// From where the actuators were, [`Kmeans2d`], each group of parts on its own.
    fn follow(&mut self, profile: &Profile, contacts: &Contacts, levels: &Levels, out: &mut Vec<Actuator>) {
        let mut x = &contacts.x;
        if profile.parts_apart {
            let parts = contacts.x.iter().zip(&contacts.part);
            self.apart.clear();
            self.apart
                .extend(parts.map(|(x, part)| x + PART_DISTANCE * f64::from(*part)));
            x = &self.apart;
        }
        let points = Plane { x, y: &contacts.y };
        let weighted = profile.force_weighted;
        let asks = match &mut self.groups[..] {
            [all] => all.follower.asks_for_heights(&contacts.rank, weighted),
            groups => {
                Self::share_out(groups, &self.group_of_part, contacts, points);
                let asks = |group: &Group| group.follower.asks_for_heights(&group.key, weighted);
                groups.iter().any(asks)
            }
        };
        self.heights.clear();
        // In most frames of a contact that is held nobody asks.
        if asks && profile.force_distance > 0.0 {
            self.heights.raise(contacts, profile.force_distance * self.pitch);
        }
        if let [all] = &mut self.groups[..] {
            let weights = weighted.then_some(&contacts.force[..]);
            let clusters = all
                .follower
                .follow(points, &contacts.rank, weights, self.heights.get());
            self.cluster.clear();
            self.cluster.extend_from_slice(clusters.labels);
            // A budget for the only part may be less than all actuators.
            self.member[..clusters.member.len()].copy_from_slice(clusters.member);
        } else {
            self.follow_groups(weighted, contacts.len());
        }
        self.press(profile, contacts, levels, out);
    }

    /// Gives each group the contacts of its parts.
    fn share_out(groups: &mut [Group], group_of_part: &[usize], contacts: &Contacts, at: Plane<'_>) {
        for group in groups.iter_mut() {
            group.contact.clear();
            group.x.clear();
            group.y.clear();
            group.key.clear();
            group.force.clear();
        }
        for n in 0..contacts.len() {
            let group = &mut groups[group_of_part[usize::from(contacts.part[n])]];
            group.contact.push(n as u32);
            group.x.push(at.x[n]);
            group.y.push(at.y[n]);
            group.key.push(contacts.rank[n]);
            group.force.push(contacts.force[n]);
        }
    }

    fn follow_groups(&mut self, force_weighted: bool, contacts: usize) {
        self.cluster.clear();
        self.cluster.resize(contacts, 0);
        self.member.fill(None);
        for group in &mut self.groups {
            let points = Plane {
                x: &group.x,
                y: &group.y,
            };
            let weights = force_weighted.then_some(&group.force[..]);
            let heights = self.heights.get().map(|all| {
                group.height.clear();
                group
                    .height
                    .extend(group.contact.iter().map(|n| all[*n as usize]));
                &group.height[..]
            });
            let clusters = group.follower.follow(points, &group.key, weights, heights);
            for (n, label) in group.contact.iter().zip(clusters.labels) {
                self.cluster[*n as usize] = group.first_id + label;
            }
            for (id, member) in clusters.member.iter().enumerate() {
                self.member[usize::from(group.first_id) + id] = member.map(|n| group.contact[n as usize]);
            }
        }
    }

    /// The publication's Table I: few contacts pass through, many are gathered by Lloyd's iterations.
    ///
    /// - `N_C <= K_A`, eq. (12): actuator `n` stands on contact `n` and presses with its level.
    /// - init: [`maximin`] over the contacts in raster order.
    /// - distance, ties, update, empty cluster, iterations: [`lloyd2d`] on pixels, `I_A` times.
    /// - snap: an actuator stands on the member nearest its centroid, [`medoids`].
    /// - force: [`ActuatorForce`].
    pub(crate) fn lloyd(
        &mut self,
        profile: &Profile,
        contacts: &Contacts,
        levels: &Levels,
        out: &mut Vec<Actuator>,
    ) {
        if contacts.len() <= usize::from(profile.actuators) {
            self.cluster.clear();
            self.cluster.extend(0..contacts.len() as u16);
            self.member.fill(None);
            for (n, member) in self.member.iter_mut().take(contacts.len()).enumerate() {
                *member = Some(n as u32);
            }
            self.press(profile, contacts, levels, out);
            return;
        }
        let points = Plane {
            x: &contacts.x,
            y: &contacts.y,
        };
        self.nearest.resize(contacts.len(), 0.0);
        self.cluster.resize(contacts.len(), 0);
        maximin(points, &mut self.x, &mut self.y, &mut self.nearest);
        lloyd2d(
            points,
            profile.force_weighted.then_some(&contacts.force[..]),
            profile.actuator_iterations,
            &mut self.x,
            &mut self.y,
            &mut self.cluster,
            &mut self.sums,
        );
        medoids(
            points,
            &self.cluster,
            &self.x,
            &self.y,
            &mut self.least,
            &mut self.member,
        );
        self.press(profile, contacts, levels, out);
    }

    /// Puts each cluster's actuator on its member and gives it its force.
    fn press(&mut self, profile: &Profile, contacts: &Contacts, levels: &Levels, out: &mut Vec<Actuator>) {
        out.clear();
        self.pressing.fill(Pressing::default());
        let kind = profile.actuator_force();
        for ((cluster, &level), measured) in self.cluster.iter().zip(&levels.level).zip(&contacts.force) {
            let pressing = &mut self.pressing[usize::from(*cluster)];
            pressing.highest = pressing.highest.max(level);
            pressing.sum += match kind {
                ActuatorForce::Mean => levels.codebook[usize::from(level)],
                _ => *measured,
            };
            pressing.count += 1;
        }
        for (id, (member, pressing)) in self.member.iter().zip(&self.pressing).enumerate() {
            let Some(member) = *member else {
                self.held[id] = 0;
                continue;
            };
            // A contact of its own has its own level, which hysteresis may hold.
            let level = if kind == ActuatorForce::Max || pressing.count == 1 {
                pressing.highest
            } else {
                let mean = pressing.sum / f64::from(pressing.count);
                let nearest = levels.nearest(mean);
                if kind == ActuatorForce::Closest && profile.level_hysteresis > 0.0 {
                    levels.keep(profile.level_hysteresis, self.held[id], mean, nearest)
                } else {
                    nearest
                }
            };
            self.held[id] = level + 1;
            let [x, y] = match &self.fixed {
                Some(fixed) => fixed.pixel[id],
                None => contacts.pixel[member as usize],
            };
            out.push(Actuator {
                id: id as u16,
                x,
                y,
                level: level + 1,
                force: levels.codebook[usize::from(level)],
            });
        }
    }
}
