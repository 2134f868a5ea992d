//! Links between cells of water and the closed cells behind the mouths of wide joints.
//!
//! A mouth is a wall that moves with the discharge of its joint: the populations that it reflects gain the volume `V`
//! that leaves the joint in a step, in parts `s_l` in proportion to `w_l c_l.n u` with the weight and the velocity of
//! each link, the normal of the mouth and the profile `u` of laminar flow between the faces. On a flat face this is
//! half-way bounce-back at a wall with the velocity of the discharge (A. J. C. Ladd, J. Fluid Mech. 271 (1994) 285),
//! with mass and momentum of the jet, and exact in mass on any face. A volume that enters the cells at rest instead
//! lowers their pressure by the normal stress `3 mu u/h` of the divergence: an error that grows as the cells become
//! smaller.
//!
//! The pressure of a mouth is that of the same populations, `sum of s_l f_l/w_l`: the traction of the water on the
//! mouth, at the place of the mouth. In the norm in which the populations of a lattice lose energy, `sum of f²/w`,
//! the volume gives the lattice the energy `V p + V²/2 sum of s_l²/w_l`. The network is therefore driven by the
//! pressure `p + V/2 sum of s_l²/w_l`, with the discharge of its own implicit stages
//! ([`joints::flow::Drive::resistance`]): that of the middle of the step, at which half of the volume has entered.
//! The stages pay at least the energy that the lattice receives, so that the coupling is stable for any step and
//! friction.
//!
//! Sums are sums of integers, which do not depend on the ranks.

use super::Jointed;
use super::mouths::words;
use crate::FluidView;
use crate::body_map::JointLink;
use crate::joint_water::MouthAt;
use crate::lattice::LatticeFlow;
use base::number::real;
use decomposition::Domain;
use dem::space::Space;
use lbm::lanes::Stored;
use lbm::populations::Link;
use lbm::quanta::{from_quanta, quanta};
use nalgebra::Vector3;

/// Number of words of a mouth that ranks exchange: index and three sums.
const WORDS: usize = 4;
/// Maximum distance of a link from its mouth \[cells\].
const REACH: f64 = 2.0;
/// Minimum component of a link along the normal of its mouth.
const INTO: f64 = 0.1;

/// Link through a mouth.
#[derive(Clone, Copy, Debug)]
struct Through {
    link: Link,
    mouth: usize,
    /// Weight of the velocity, and its component into the joint times the profile of the flow, with a mean of 1.
    weight: f64,
    into: f64,
}

/// Sums over the links of a mouth, in quanta: of `w c.n`, of `w (c.n)²` and of `f c.n`.
type Sums = [i128; 3];

/// Links through the mouths of a network.
#[derive(Clone, Debug, Default)]
pub(super) struct MouthLinks {
    /// Number of the network and of the links of the map for which the list was made.
    made_for: Option<(u64, u64)>,
    list: Vec<Through>,
    /// Sum of the weights of all links of each mouth in the last step.
    totals: Vec<f64>,
    sums: Vec<Sums>,
    bytes: Vec<u8>,
}

/// Returns the vector from the middle of a mouth to a point, or to its nearest image at one of the shifts \[m\].
fn offset(mouth: &MouthAt, point: &Vector3<f64>, shifts: &[Vector3<f64>]) -> Vector3<f64> {
    let images = shifts.iter().map(|shift| point - mouth.middle + shift);
    let nearest = images.min_by(|a, b| a.norm_squared().total_cmp(&b.norm_squared()));
    nearest.unwrap_or_default()
}

/// Returns the distance of a point, by its [`offset`], from the rectangle of a mouth \[m\].
fn distance(mouth: &MouthAt, offset: &Vector3<f64>) -> f64 {
    let along = mouth.normal.cross(&mouth.outward);
    let beyond = |axis: &Vector3<f64>, size: f64| (axis.dot(offset).abs() - 0.5 * size).max(0.0);
    Vector3::new(
        mouth.outward.dot(offset),
        beyond(&mouth.normal, mouth.size[0]),
        beyond(&along, mouth.size[1]),
    )
    .norm()
}

impl<Sp: Space, S: Stored> Jointed<Sp, S> {
    /// Assigns the links into closed cells to the mouths, if links or network have changed.
    fn find_mouth_links(&mut self) {
        let (links, found) = self.lattice.map().joint_links();
        let made_for = Some((self.joints.networks(), found));
        if self.links.made_for == made_for {
            return;
        }
        let mouths = self.joints.mouths_at();
        let network = self.joints.flow().network();
        let mut of_joint = vec![Vec::new(); network.joints.len()];
        for (mouth, piece) in network.open.iter().enumerate() {
            of_joint[piece.joint].push(mouth);
        }
        let all: Vec<usize> = (0..mouths.len()).collect();
        let velocities = LatticeFlow::fluid(&self.lattice).populations().velocities();
        let (spacing, start) = (self.lattice.units().spacing, self.lattice.start());
        let shifts = self.shifts();
        let through = |link: &JointLink| {
            let c = velocities.c[link.direction].map(f64::from);
            let at = |axis: usize| {
                let inner = f64::from(link.inner[axis]) + real(start[axis]);
                (inner + 0.5 - 0.5 * c[axis]) * spacing
            };
            let middle = Vector3::new(at(0), at(1), at(2));
            // The cell of water distinguishes a mouth from the edge of a joint that the link passes.
            let outer = middle - Vector3::from(c) * (0.5 * spacing);
            let joint = self.joint_of.get(&link.inner).copied();
            let own = joint.and_then(|joint| of_joint.get(joint));
            let nearest = |among: &[usize]| {
                let distances = among.iter().map(|&m| {
                    let mouth = &mouths[m];
                    distance(mouth, &offset(mouth, &outer, &shifts))
                });
                let near = among.iter().copied().zip(distances);
                let near = near.filter(|(_, distance)| *distance <= REACH * spacing);
                near.min_by(|a, b| a.1.total_cmp(&b.1))
                    .map(|(mouth, _)| mouth)
            };
            let mouth = own.and_then(|own| nearest(own)).or_else(|| nearest(&all))?;
            let front = &mouths[mouth];
            let into = -front.outward.dot(&Vector3::from(c));
            let across = front.normal.dot(&offset(front, &middle, &shifts)) / front.size[0];
            let profile = 1.5 - 6.0 * across * across;
            (into >= INTO && profile > 0.0).then_some(Through {
                link: link.link,
                mouth,
                weight: velocities.w[link.direction],
                into: into * profile,
            })
        };
        self.links.list = links.iter().filter_map(through).collect();
        self.links.totals.clear();
        self.links.totals.resize(mouths.len(), 0.0);
        self.links.made_for = made_for;
    }

    /// Returns the pressure in front of each mouth \[Pa\], none if there is no water, and its increase per discharge
    /// out of the joint [Pa s/m³]. Collective.
    pub(super) fn fronts(&mut self, domain: &Domain) -> (Vec<Option<f64>>, Vec<f64>) {
        self.find_mouth_cells();
        self.find_mouth_links();
        let (mut fronts, mut resistances) = self.front_links(domain);
        self.front_cells(&mut fronts, &mut resistances, domain);
        (fronts, resistances)
    }

    /// Returns the pressures at the mouths with links \[Pa\], and their increase per discharge [Pa s/m³]. Collective.
    fn front_links(&mut self, domain: &Domain) -> (Vec<Option<f64>>, Vec<f64>) {
        let units = *self.lattice.units();
        let populations = LatticeFlow::fluid(&self.lattice).populations();
        let (parity, numbers) = (populations.parity(), populations.numbers());
        let links = &mut self.links;
        let mouths = links.totals.len();
        links.sums.clear();
        links.sums.resize(mouths, Sums::default());
        for one in &links.list {
            let f = numbers[one.link.incoming(parity)].to_f64();
            let weight = one.weight * one.into;
            let parts = [weight, weight * one.into, one.into * f];
            for (sum, part) in links.sums[one.mouth].iter_mut().zip(parts) {
                *sum += i128::from(quanta(part));
            }
        }
        links.bytes.clear();
        for (mouth, sums) in links.sums.iter_mut().enumerate() {
            if sums[0] > 0 {
                links.bytes.extend((mouth as u64).to_le_bytes());
                for sum in std::mem::take(sums) {
                    let sum = i64::try_from(sum).unwrap_or(i64::MAX);
                    links.bytes.extend(sum.to_le_bytes());
                }
            }
        }
        for message in domain.communicator().all_gather_bytes(&links.bytes) {
            for row in message.chunks_exact(8 * WORDS) {
                let [mouth, sums @ ..] = words::<WORDS>(row);
                let mouth = usize::try_from(mouth).unwrap_or(usize::MAX);
                if let Some(all) = links.sums.get_mut(mouth) {
                    for (all, sum) in all.iter_mut().zip(sums) {
                        *all += i128::from(sum.cast_signed());
                    }
                }
            }
        }
        let each = self.joints.lattice_step() * self.joints.density_ratio() / units.spacing.powi(3);
        let all = links.sums.iter().zip(&mut links.totals);
        all.map(|(sums, total)| {
            let [weight, squares, pressure] = sums.map(from_quanta);
            *total = weight;
            if weight <= 0.0 {
                return (None, 0.0);
            }
            let half = 0.5 * each * squares / (weight * weight);
            let [pressure, half] =
                [pressure / weight, half].map(|d| units.density_deviation_to_pressure(d));
            (Some(pressure), half)
        })
        .unzip()
    }

    /// Adds the water from the last step of the joints that returns in this step of the lattice.
    pub(super) fn return_water(&mut self) {
        let returning = self.joints.take_returning();
        if returning.is_empty() {
            return;
        }
        let mut volumes = vec![0.0; self.links.totals.len()];
        for (mouth, volume) in returning {
            volumes[mouth] += volume;
        }
        let ratio = self.joints.density_ratio() / self.lattice.units().spacing.powi(3);
        let populations = LatticeFlow::fluid_mut(&mut self.lattice).populations_mut();
        let parity = populations.parity();
        let numbers = populations.numbers_mut();
        for one in &self.links.list {
            let part = one.weight * one.into / self.links.totals[one.mouth];
            let number = &mut numbers[one.link.incoming(parity)];
            *number = S::from_f64(number.to_f64() + volumes[one.mouth] * ratio * part);
        }
        self.return_to_cells(&volumes);
    }
}
