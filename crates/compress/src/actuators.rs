//! Actuator quantisation, eqs (8) to (12): where the display presses, and how hard.

use taxel_cluster::{Kmeans2d, Kmeans2dSettings, Plane, lloyd2d, maximin, medoids, nearest1d};

use crate::contacts::Contacts;
use crate::levels::Levels;
use crate::{Actuator, ActuatorForce, Placement, Profile};

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
    follower: Kmeans2d,
    /// Columns moved apart by part of the hand.
    apart: Vec<f64>,
}

/// How far columns of different parts of the hand are moved apart, pixels: an actuator in between would be worth nothing.
const PART_DISTANCE: f64 = 4096.0;

/// What presses on an actuator.
#[derive(Debug, Default, Clone, Copy)]
struct Pressing {
    highest: u16,
    sum: f64,
    count: u32,
}

impl Actuators {
    /// Memory for `taxels` contacts.
    pub(crate) fn new(profile: &Profile, taxels: usize) -> Self {
        let most = usize::from(profile.actuators);
        Self {
            x: vec![0.0; most],
            y: vec![0.0; most],
            cluster: Vec::with_capacity(taxels),
            sums: vec![[0.0; 3]; most],
            least: vec![0.0; most],
            member: vec![None; most],
            nearest: Vec::with_capacity(taxels),
            pressing: vec![Pressing::default(); most],
            follower: Kmeans2d::new(taxels, most, settings(profile)),
            apart: Vec::with_capacity(taxels),
        }
    }

    /// Places the actuators of a frame and says how hard each presses.
    pub(crate) fn place(
        &mut self,
        profile: &Profile,
        contacts: &Contacts,
        levels: &Levels,
        out: &mut Vec<Actuator>,
    ) {
        match profile.placement() {
            Placement::Lloyd => self.lloyd(profile, contacts, levels, out),
            Placement::Follow => self.follow(profile, contacts, levels, out),
        }
    }

    /// Number of the cluster each contact belongs to: the id of its actuator.
    pub(crate) fn cluster(&self) -> &[u16] {
        &self.cluster
    }

    /// From where the actuators were, [`Kmeans2d`]; each stands on the contact of its cluster nearest the centroid.
    fn follow(&mut self, profile: &Profile, contacts: &Contacts, levels: &Levels, out: &mut Vec<Actuator>) {
        let mut points = Plane {
            x: &contacts.x,
            y: &contacts.y,
        };
        if profile.parts_apart {
            self.apart.clear();
            self.apart.extend(
                contacts
                    .x
                    .iter()
                    .zip(&contacts.part)
                    .map(|(x, part)| x + PART_DISTANCE * f64::from(*part)),
            );
            points.x = &self.apart;
        }
        let weights = profile.force_weighted.then_some(&contacts.force[..]);
        let clusters = self.follower.follow(points, &contacts.rank, weights);
        self.cluster.clear();
        self.cluster.extend_from_slice(clusters.labels);
        self.member.copy_from_slice(clusters.member);
        self.press(profile, contacts, levels, out);
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
            out.clear();
            out.extend((contacts.pixel.iter().zip(&levels.level).enumerate()).map(
                |(id, (&[x, y], &level))| Actuator {
                    id: id as u16,
                    x,
                    y,
                    level: level + 1,
                    force: levels.codebook[usize::from(level)],
                },
            ));
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
        for (cluster, &level) in self.cluster.iter().zip(&levels.level) {
            let pressing = &mut self.pressing[usize::from(*cluster)];
            pressing.highest = pressing.highest.max(level);
            pressing.sum += levels.codebook[usize::from(level)];
            pressing.count += 1;
        }
        for (id, (member, pressing)) in self.member.iter().zip(&self.pressing).enumerate() {
            let Some(member) = *member else { continue };
            let level = match profile.actuator_force {
                ActuatorForce::Max => pressing.highest,
                ActuatorForce::Mean => {
                    nearest1d(pressing.sum / f64::from(pressing.count), &levels.codebook) as u16
                }
            };
            let [x, y] = contacts.pixel[member as usize];
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

/// How the follower works for a profile.
fn settings(profile: &Profile) -> Kmeans2dSettings {
    Kmeans2dSettings {
        history: profile.history,
        swap_gain: profile.jump_gain,
        swaps: 4,
        iterations: 6,
        reach: 2.0,
    }
}
