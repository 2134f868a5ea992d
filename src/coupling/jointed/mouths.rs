//! Cells of the lattice in front of mouths that no closed cell fills: their pressures, and the water that returns to
//! them. Such mouths are those of joints thinner than a cell.
//!
//! The cells are found once for each network. In a step those count that contain water.

use super::Jointed;
use crate::joint_water::MouthAt;
use crate::lattice::LatticeFlow;
use crate::{FluidView, bounce_back::BounceBack};
use base::number::{real, whole};
use decomposition::Domain;
use dem::space::Space;
use joints::network::WIDE_CELLS;
use lbm::lanes::Stored;
use nalgebra::Vector3;
use std::collections::HashMap;
use std::ops::Range;

/// Bytes of a pressure that ranks exchange: index of the cell, pressure.
const ROW: usize = 16;
/// Distance from a mouth of the two points, one on each side of its joint, where water is searched \[cells\].
const MOUTH_DISTANCE: f64 = 0.25;
/// Points per cell, along each side of the rectangle of a mouth, at which cells of water are searched.
const POINTS_PER_CELL: f64 = 2.0;

/// Cell in front of a mouth.
#[derive(Clone, Copy, Debug)]
struct FrontCell {
    /// Number of points of the rectangle of the mouth in the cell.
    points: f64,
    /// Index of the cell among all cells in front of mouths.
    index: usize,
    /// Part of the mouth in front of it in the last step; 0 if it contains no water.
    part: f64,
    /// Pressure in the last step \[Pa\]; NaN if it contains no water.
    pressure: f64,
}

/// Cells in front of the mouths of a network.
#[derive(Clone, Debug, Default)]
pub(super) struct MouthCells {
    /// Number of the network; none before the first.
    network: Option<u64>,
    /// First cell of each mouth in the list, and the number of all.
    firsts: Vec<usize>,
    list: Vec<FrontCell>,
    /// `true` for each mouth with several cells.
    wide: Vec<bool>,
    /// Cells of this slab: number in the list, local coordinates and position.
    own: Vec<(usize, [usize; 3], usize)>,
    /// Volumes that entered the cells \[m³\], by their indices.
    volumes: Vec<f64>,
    bytes: Vec<u8>,
}

impl MouthCells {
    /// Returns the cells of a mouth.
    fn cells_of(&self, mouth: usize) -> Range<usize> {
        self.firsts[mouth]..self.firsts[mouth + 1]
    }

    /// Returns the mean pressure in front of a mouth \[Pa\]; none if there is no water.
    fn weigh(&mut self, mouth: usize) -> Option<f64> {
        let (wide, cells) = (self.wide[mouth], self.cells_of(mouth));
        let cells = &mut self.list[cells];
        let mut points = 0.0;
        for cell in cells.iter_mut() {
            let counts = !cell.pressure.is_nan() && (wide || points == 0.0);
            cell.part = if counts { cell.points } else { 0.0 };
            points += cell.part;
        }
        if points == 0.0 {
            return None;
        }
        let mut pressure = 0.0;
        for cell in cells.iter_mut().filter(|cell| cell.part > 0.0) {
            cell.part /= points;
            pressure += cell.part * cell.pressure;
        }
        Some(pressure)
    }
}

/// Returns the words of a row of a message.
pub(super) fn words<const N: usize>(row: &[u8]) -> [u64; N] {
    std::array::from_fn(|k| {
        let mut bytes = [0; 8];
        bytes.copy_from_slice(&row[8 * k..8 * k + 8]);
        u64::from_le_bytes(bytes)
    })
}

/// Returns the cell of the domain that contains a point \[m\]; none outside the domain.
fn cell_of_domain<Sp: Space, S: Stored>(
    lattice: &BounceBack<Sp, S>,
    point: &Vector3<f64>,
) -> Option<[usize; 3]> {
    let fluid = LatticeFlow::fluid(lattice);
    let (all, periodic) = (fluid.domain_cells(), fluid.periodic());
    let spacing = lattice.units().spacing;
    let mut cell = [0; 3];
    for axis in 0..3 {
        let length = real(all[axis]);
        let mut at = (point[axis] / spacing).floor();
        if periodic[axis] {
            at -= (at / length).floor() * length;
        }
        if !(at >= 0.0 && at < length) {
            return None;
        }
        cell[axis] = whole(at);
    }
    Some(cell)
}

/// Returns the coordinates in the slab of a cell of the domain, if the slab contains it.
fn cell_of_slab<Sp: Space, S: Stored>(
    lattice: &BounceBack<Sp, S>,
    cell: [usize; 3],
) -> Option<[usize; 3]> {
    let (start, cells) = (lattice.start(), lattice.cells());
    let mut local = [0; 3];
    for axis in 0..3 {
        local[axis] = cell[axis].checked_sub(start[axis])?;
        if local[axis] >= cells[axis] {
            return None;
        }
    }
    Some(local)
}

/// Finds the cells in front of a mouth, each with its number of points. At a narrow joint these are two, one on each
/// side of the joint; at a wide one those in front of its rectangle.
fn cells_before<Sp: Space, S: Stored>(
    lattice: &BounceBack<Sp, S>,
    mouth: &MouthAt,
    to: &mut Vec<([usize; 3], f64)>,
) {
    to.clear();
    let spacing = lattice.units().spacing;
    let point = mouth.middle + mouth.outward * (0.5 * spacing);
    let [aperture, width] = mouth.size;
    if aperture <= WIDE_CELLS * spacing {
        let beside = mouth.normal * (MOUTH_DISTANCE * spacing);
        let cells = [point + beside, point - beside];
        let cells = cells.map(|point| cell_of_domain(lattice, &point));
        to.extend(cells.into_iter().flatten().map(|cell| (cell, 1.0)));
        return;
    }
    let count = |length: f64| (POINTS_PER_CELL * length / spacing - 1e-6).ceil().max(2.0);
    let counts = [count(aperture), count(width)];
    let steps = [
        mouth.normal * (aperture / counts[0]),
        mouth.normal.cross(&mouth.outward) * (width / counts[1]),
    ];
    for row in 0..whole(counts[1]) {
        for column in 0..whole(counts[0]) {
            let at = [real(column), real(row)];
            let offsets: [Vector3<f64>; 2] =
                std::array::from_fn(|k| steps[k] * (at[k] + 0.5 - 0.5 * counts[k]));
            let Some(cell) = cell_of_domain(lattice, &(point + offsets[0] + offsets[1])) else {
                continue;
            };
            match to.iter_mut().find(|(known, _)| *known == cell) {
                Some((_, points)) => *points += 1.0,
                None => to.push((cell, 1.0)),
            }
        }
    }
}

impl<Sp: Space, S: Stored> Jointed<Sp, S> {
    /// Finds the cells in front of the mouths, if the network is another one than before.
    pub(super) fn find_mouth_cells(&mut self) {
        let number = self.joints.networks();
        if self.cells.network == Some(number) {
            return;
        }
        let mut cells = MouthCells {
            network: Some(number),
            bytes: std::mem::take(&mut self.cells.bytes),
            ..MouthCells::default()
        };
        let spacing = self.lattice.units().spacing;
        let mut indices = HashMap::new();
        let mut before = Vec::new();
        cells.firsts.push(0);
        for mouth in self.joints.mouths_at() {
            cells_before(&self.lattice, &mouth, &mut before);
            for &(cell, points) in &before {
                let next = indices.len();
                let index = *indices.entry(cell).or_insert(next);
                if let Some(local) = cell_of_slab(&self.lattice, cell) {
                    let populations = LatticeFlow::fluid(&self.lattice).populations();
                    let position = populations.interior_cell(local);
                    cells.own.push((cells.list.len(), local, position));
                }
                cells.list.push(FrontCell {
                    points,
                    index,
                    part: 0.0,
                    pressure: f64::NAN,
                });
            }
            cells.firsts.push(cells.list.len());
            cells.wide.push(mouth.size[0] > WIDE_CELLS * spacing);
        }
        cells.volumes = vec![0.0; indices.len()];
        self.cells = cells;
    }

    /// Finds the mean pressures of the cells of water in front of the mouths that have none yet \[Pa\], and their
    /// increase per discharge out of the joint [Pa s/m³]. Collective.
    pub(super) fn front_cells(
        &mut self,
        fronts: &mut [Option<f64>],
        resistances: &mut [f64],
        domain: &Domain,
    ) {
        if fronts.iter().all(Option::is_some) {
            for cell in &mut self.cells.list {
                cell.part = 0.0;
            }
            return;
        }
        let units = *self.lattice.units();
        let populations = LatticeFlow::fluid(&self.lattice).populations();
        self.cells.bytes.clear();
        for &(number, local, position) in &self.cells.own {
            if !self.lattice.solid_at(local) {
                let (deviation, _) = populations.moments(position);
                let pressure = units.density_deviation_to_pressure(deviation);
                self.cells.bytes.extend((number as u64).to_le_bytes());
                self.cells.bytes.extend(pressure.to_le_bytes());
            }
        }
        for cell in &mut self.cells.list {
            cell.pressure = f64::NAN;
        }
        let communicator = domain.communicator();
        for message in communicator.all_gather_bytes(&self.cells.bytes) {
            for row in message.chunks_exact(ROW) {
                let [number, pressure] = words(row);
                let number = usize::try_from(number).unwrap_or(usize::MAX);
                if let Some(cell) = self.cells.list.get_mut(number) {
                    cell.pressure = f64::from_bits(pressure);
                }
            }
        }
        let mut wide = Vec::new();
        for (mouth, front) in fronts.iter_mut().enumerate() {
            if front.is_some() {
                let cells = self.cells.cells_of(mouth);
                self.cells.list[cells]
                    .iter_mut()
                    .for_each(|cell| cell.part = 0.0);
                continue;
            }
            *front = self.cells.weigh(mouth);
            if self.cells.wide[mouth] {
                wide.push(mouth);
            }
        }
        self.add_half_of_discharge(&wide, fronts);
        self.add_resistances(resistances);
    }

    /// Adds half of the increase of the pressure by the present discharge, per discharge, at the mouths of narrow
    /// joints. Mouths that share cells count as if all had the same discharge: then the network pays at least the
    /// energy that the cells receive. A wide mouth counts the narrow ones with which it shares cells.
    fn add_resistances(&mut self, resistances: &mut [f64]) {
        let cells = &mut self.cells;
        let [mut all, mut narrow] = [0, 1].map(|_| vec![0.0; cells.volumes.len()]);
        for mouth in 0..cells.wide.len() {
            for cell in &cells.list[cells.cells_of(mouth)] {
                all[cell.index] += cell.part;
                if !cells.wide[mouth] {
                    narrow[cell.index] += cell.part;
                }
            }
        }
        let units = self.lattice.units();
        let volume = self.joints.lattice_step() * self.joints.density_ratio();
        let increase = units.density_deviation_to_pressure(volume / units.spacing.powi(3));
        for (mouth, resistance) in resistances.iter_mut().enumerate() {
            let shares = if cells.wide[mouth] { &narrow } else { &all };
            let list = &cells.list[cells.cells_of(mouth)];
            let sum: f64 = list.iter().map(|one| one.part * shares[one.index]).sum();
            *resistance += 0.5 * increase * sum;
        }
    }

    /// Adds half of the increase of the pressure by the last discharge to the pressures at these wide mouths.
    fn add_half_of_discharge(&mut self, wide: &[usize], fronts: &mut [Option<f64>]) {
        if wide.is_empty() {
            return;
        }
        let cells = &mut self.cells;
        let units = self.lattice.units();
        let outflows = self.joints.flow().outflows();
        cells.volumes.fill(0.0);
        for &mouth in wide {
            let volume = outflows[mouth] * self.joints.lattice_step();
            for cell in &cells.list[cells.cells_of(mouth)] {
                cells.volumes[cell.index] += cell.part * volume;
            }
        }
        let ratio = self.joints.density_ratio() / units.spacing.powi(3);
        let half = 0.5 * units.density_deviation_to_pressure(ratio);
        for &mouth in wide {
            let Some(front) = &mut fronts[mouth] else {
                continue;
            };
            for cell in &cells.list[cells.cells_of(mouth)] {
                *front += cell.part * half * cells.volumes[cell.index];
            }
        }
    }

    /// Adds volumes of water that left the mouths in the last step \[m³\] to the cells in front of those without links.
    pub(super) fn return_to_cells(&mut self, volumes: &[f64]) {
        let cells = &self.cells;
        let ratio = self.joints.density_ratio() / self.lattice.units().spacing.powi(3);
        let populations = LatticeFlow::fluid_mut(&mut self.lattice).populations_mut();
        let mut own = cells.own.iter().peekable();
        for (mouth, volume) in volumes.iter().enumerate() {
            let end = cells.firsts[mouth + 1];
            while let Some(&(number, _, cell)) = own.next_if(|(number, ..)| *number < end) {
                let part = cells.list[number].part;
                if part == 0.0 || *volume == 0.0 {
                    continue;
                }
                for i in 0..populations.velocities().q() {
                    let weight = populations.velocities().w[i];
                    let position = populations.incoming(cell, i);
                    let number = &mut populations.numbers_mut()[position];
                    *number = S::from_f64(number.to_f64() + weight * (volume * part) * ratio);
                }
            }
        }
    }
}
