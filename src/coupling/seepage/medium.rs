//! Porosity, permeability and pressure for the present positions of the grains: see the module above for the
//! equations.

use super::bed::{self, Laws, Sum};
use super::water::{Ground, Secant};
use super::{FILLED, Seepage, components, failed};
use base::error::Error;
use base::thread_pool;
use base::vector::norm;
use darcy::drag::gidaspow::dense_share;
use darcy::drag::{self, GrainSize};
use darcy::open_water::{openness, rise};
use darcy::pressure::Medium;
use darcy::resistance::{BedOfCells, larger};
use darcy::zones::ZonePermeability;
use darcy::{Equations, Openness, Zones, neighbourhood};
use dem::particles::ParticlesView;
use dem::space::Space;
use std::sync::Arc;

/// Relative change of a coefficient in a round below which the rounds continue in the next coupling, if grains move
/// meanwhile.
const CONTINUED_CHANGE: f64 = 2e-3;
/// Relative change of a coefficient in a round at which it is converged: a multiple of the tolerance of the
/// pressure, and a minimum.
const SETTLED: f64 = 100.0;
const MIN_SETTLED: f64 = 1e-11;
/// Number of rounds after which a change of this size is accepted: it may be the rounding error of a pressure that
/// has almost no drive.
const STALLED_ROUNDS: u32 = 50;
const STALLED_CHANGE: f64 = 1e-5;
/// Maximum number of rounds: the error at least halves in each.
const MAX_ROUNDS: u32 = 200;
/// Solid fraction up to which the reaction of grains does not move the water around them; above
/// [`DENSE_FRACTION`] it moves the water fully.
const DILUTE_FRACTION: f64 = 0.02;
const DENSE_FRACTION: f64 = 0.05;
/// Porosity above which the permeability of a zone changes to that of its grains.
const LOOSE_POROSITY: f64 = 0.8;
/// Maximum porosity of the permeability law above which open water has only the resistance of its channel.
const FREE: f64 = 0.9999;
/// Minimum fraction of a cell that counts as pores in the balance of momentum.
const MIN_PORES: f64 = 1e-6;
/// Relative difference of the two speeds with which the slope of a law is computed.
const SPEED_DIFFERENCE: f64 = 1e-4;

/// Returns d log R/d log u of a resistance at a speed.
fn slope(resistance: impl Fn(f64) -> f64, speed: f64) -> f64 {
    let here = resistance(speed);
    if speed > 0.0 && here > 0.0 {
        ((resistance(speed * (1.0 + SPEED_DIFFERENCE)) / here - 1.0) / SPEED_DIFFERENCE)
            .clamp(0.0, 4.0)
    } else {
        0.0
    }
}

impl<Sp: Space> Seepage<Sp> {
    /// Computes porosity, permeability and pressure for the present positions of the grains. Collective.
    pub(super) fn solve_pressure(
        &mut self,
        particles: &ParticlesView<'_, Sp>,
    ) -> Result<(), Error> {
        self.parts.find(&self.pores, particles);
        self.pores.clear();
        for (k, parts) in self.parts.each() {
            let centre = components(&particles.location(k));
            self.pores.add(centre, particles.body[k].radius, parts);
        }
        self.pores
            .finish(&self.openness, &self.communicator)
            .map_err(failed)?;
        let permeability = self.settings.resistance;
        let porosity = self.pores.porosity();
        for cell in 0..porosity.len() {
            self.limited[cell] = permeability.limited(porosity[cell]);
            self.source[cell] = (self.earlier.porosity[cell] - porosity[cell])
                * self.openness.inside[cell]
                / self.settings.interval;
        }
        if let Some((zones, permeability_of_zones)) = &mut self.zones {
            permeability_of_zones
                .replace_porosity(zones, &mut self.limited, |cell| porosity[cell] < FILLED);
        }
        if self.following.acts() {
            let before = self.earlier.known.then_some(&self.earlier.porosity[..]);
            // Open water conducts like loose ground.
            let limits = [
                permeability.least_porosity,
                FILLED.min(permeability.porosity_cap),
            ];
            self.following.take(before, porosity, limits);
            self.pressure.set_pore_volumes(self.following.parts());
        }
        self.compute_porosities();
        self.measure_open_water();
        self.report.iterations = self.iterate_until_converged(particles)?;
        self.earlier.porosity.copy_from_slice(self.pores.porosity());
        self.earlier.known = true;
        Ok(())
    }

    /// Measures the channels of open water.
    fn measure_open_water(&mut self) {
        if self.settings.equations == Equations::Paper {
            return;
        }
        let porosity = self.pores.porosity();
        let zones = self.zones.as_ref();
        let openness_of = |cell: usize| {
            if self.openness.blocked(cell) {
                return (0.0, 1.0);
            }
            let free = zones.map_or(1.0, |(_, permeability_of_zones)| {
                permeability_of_zones.free(cell)
            });
            let ground = self.water.ground[cell].as_ref();
            (
                free.min(openness(
                    ground.map_or(1.0, |ground| ground.neighbourhood_fraction),
                )),
                free,
            )
        };
        self.water.has_open = self.water.channels.measure(&self.openness, openness_of);
        self.water.roughness = self.settings.roughness.unwrap_or_else(|| {
            // Mean diameter of the grains of the walls.
            let (mut sum, mut count) = (0.0, 0.0);
            for (cell, porosity) in porosity.iter().enumerate() {
                if !self.openness.blocked(cell) && openness(1.0 - porosity) <= 0.0 {
                    sum += self.pores.diameter()[cell];
                    count += 1.0;
                }
            }
            if count > 0.0 { sum / count } else { 0.0 }
        });
    }

    /// Computes the weights of the cells in the test of convergence: their gradient for the drag on the grains, and
    /// their water speed for its friction, relative to the largest of all cells. A coefficient counts as much as it can
    /// change the flow; in stationary water none counts.
    fn compute_weights(&mut self) {
        let (mut steepest, mut fastest) = (0.0_f64, 0.0_f64);
        for cell in 0..self.water.flux.len() {
            let (slip, drag) = (norm(self.slip(cell)), self.sums.cell(cell).drag[0]);
            let volume = self.openness.volume(cell);
            let loss = if drag > 0.0 {
                drag * slip / volume
            } else {
                0.0
            };
            steepest = steepest.max(self.water.steepness[cell]).max(loss);
            fastest = fastest.max(norm(self.water.flux[cell])).max(slip);
        }
        let of = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 1.0 };
        let water = &mut self.water;
        for (cell, weight) in water.weight.iter_mut().enumerate() {
            let speed = of(norm(water.flux[cell]), fastest);
            *weight = of(water.steepness[cell], steepest).max(speed);
        }
    }

    /// Computes the friction of open water along each axis from the present speeds, for the next round; returns the
    /// largest relative change, weighted.
    fn compute_open_water_friction(&mut self) -> f64 {
        if !self.water.has_open {
            return 0.0;
        }
        let (liquid, dimension) = (self.settings.liquid, self.openness.grid.dimension);
        let permeability = &self.settings.resistance;
        let (law, cap) = (permeability.law.model(), permeability.porosity_cap);
        let water = &mut self.water;
        let mut change = 0.0_f64;
        for cell in 0..water.still.len() {
            let open = water.channels.open(cell);
            if open <= 0.0 {
                continue;
            }
            let body = self
                .zones
                .as_ref()
                .is_some_and(|(_, permeability_of_zones)| permeability_of_zones.is_body(cell));
            let weight = water.weight[cell];
            for axis in 0..dimension {
                let duct = water.channels.duct(cell, axis);
                let mut found = duct.resistance(liquid, water.roughness, water.speed[cell]);
                if cap < FREE {
                    // The case gives open water at least the resistance of a bed.
                    let diameter = self.pores.diameter()[cell];
                    found += law.resistance(cap, diameter, liquid, water.speed[cell]);
                }
                let before = liquid.viscosity / water.open[cell][axis];
                change = larger(change, weight * (found / before - 1.0).abs());
                water.open[cell][axis] = liquid.viscosity / found;
                if !body {
                    water.friction_next[cell][axis] = open * found;
                }
            }
        }
        change
    }

    /// Returns the laws that act on the grains.
    fn laws(&self) -> Laws<'_> {
        Laws {
            drag: self.settings.drag.model(),
            resistance: self.settings.resistance.law.model(),
            settings: &self.settings,
        }
    }

    /// Computes porosities and laws of all cells, except those that depend on the flux.
    fn compute_porosities(&mut self) {
        let settings = &self.settings;
        let porosity = self.pores.porosity();
        let (least, cap) = (
            settings.resistance.least_porosity,
            settings.resistance.porosity_cap,
        );
        for cell in 0..porosity.len() {
            self.water.coupled[cell] = 0.0;
            self.water.friction[cell] = Secant::default();
            self.water.still[cell] = [0.0; 3];
            self.water.friction_next[cell] = [0.0; 3];
            self.water.ground[cell] = None;
            if self.openness.blocked(cell) {
                continue;
            }
            let diameter = self.pores.diameter()[cell];
            let solid = 1.0 - porosity[cell];
            let zone = self
                .zones
                .as_ref()
                .is_some_and(|(_, permeability_of_zones)| permeability_of_zones.is_ground(cell));
            let around = if settings.equations == Equations::Paper || zone || solid <= 0.0 {
                1.0 - self.limited[cell]
            } else {
                let around =
                    neighbourhood::solid_fraction(&self.openness, porosity, cell, diameter);
                1.0 - (1.0 - around).clamp(least, cap.max(1.0 - around))
            };
            let felt = 1.0 - around;
            self.water.coupled[cell] =
                rise((around - DILUTE_FRACTION) / (DENSE_FRACTION - DILUTE_FRACTION));
            let coupled = self.water.coupled[cell];
            let dense = if zone {
                1.0 - rise((porosity[cell] - LOOSE_POROSITY) / (FILLED - LOOSE_POROSITY))
            } else {
                dense_share(felt)
            };
            let pores = porosity[cell].max(MIN_PORES);
            self.water.ground[cell] = Some(Ground {
                bed: drag::BedConditions {
                    density: settings.liquid.density,
                    viscosity: settings.liquid.viscosity,
                    porosity: felt,
                    solid,
                    permeability: self.permeability[cell],
                },
                measure: match settings.equations {
                    // A zone states the porosity of the law; the porosity of the balances is still that of the
                    // grains.
                    Equations::Corrected if zone => settings.resistance.limited(porosity[cell]),
                    Equations::Corrected => felt,
                    Equations::Paper => 1.0,
                },
                packing: (self.limited[cell], diameter),
                factor: pores / solid.max(MIN_PORES),
                stated_resistance: None,
                displaced: if solid > around { around / solid } else { 1.0 },
                counts: !self.is_body(cell),
                neighbourhood_fraction: if solid > 0.0 { around } else { 0.0 },
                dense,
                dilute: coupled + (1.0 - coupled) / felt,
                flux: self.water.flux[cell],
                secant: Secant::default(),
                ratios: [1.0; 3],
            });
        }
    }

    /// Computes the permeability of the cells whose resistance is not a sum over grains: those of zones, and all
    /// cells if the bed counts as stationary.
    fn compute_permeability(&mut self) {
        let (settings, liquid) = (&self.settings, self.settings.liquid);
        let moves = settings.moves();
        if moves && self.zones.is_none() {
            return;
        }
        let law = settings.resistance.law.model();
        let bed = BedOfCells {
            porosity: &self.limited,
            diameter: self.pores.diameter(),
            gradient: &self.water.steepness,
        };
        law.fill(bed, liquid, &mut self.permeability);
        let Some((zones, permeability_of_zones)) = &mut self.zones else {
            for (ground, permeability) in self.water.ground.iter_mut().zip(&self.permeability) {
                if let Some(ground) = ground {
                    ground.bed.permeability = *permeability;
                }
            }
            return;
        };
        permeability_of_zones.replace(
            zones,
            law,
            (bed, &self.water.open),
            liquid,
            &mut self.permeability,
        );
        for cell in 0..self.permeability.len() {
            let Some(ground) = &mut self.water.ground[cell] else {
                continue;
            };
            let k = self.permeability[cell];
            ground.bed.permeability = k;
            ground.ratios = permeability_of_zones
                .ratios()
                .map_or([1.0; 3], |ratios| ratios[cell].map(|r| 1.0 / r));
            if permeability_of_zones.is_ground(cell) {
                ground.stated_resistance = Some(liquid.viscosity / k);
            }
            if moves && permeability_of_zones.is_body(cell) {
                self.water.still[cell] = ground.ratios.map(|r| liquid.viscosity / k * r);
            }
        }
    }

    /// Computes the flux through each cell as a linear function of the gradient.
    fn compute_flux_law(&mut self) {
        let (settings, liquid) = (&self.settings, self.settings.liquid);
        let dimension = self.openness.grid.dimension;
        let moves = settings.moves();
        let water = &mut self.water;
        for cell in 0..water.flow.len() {
            let Some(ground) = &water.ground[cell] else {
                water.flow[cell] = [(0.0, 0.0); 3];
                (water.conductivity[cell], water.carried[cell]) = (0.0, [0.0; 3]);
                water.ratios[cell] = [1.0; 3];
                continue;
            };
            let volume = self.openness.volume(cell);
            let pores = self.pores.porosity()[cell].max(MIN_PORES) * volume;
            let (sum, coupled) = (self.sums.cell(cell), water.coupled[cell]);
            let weight = coupled * f64::from(u8::from(moves));
            let mut along = [0.0; 3];
            for a in 0..dimension {
                let still = water.still[cell][a];
                let ratio = ground.ratios[a];
                let (carried, mobility) = if moves {
                    let drag = weight * sum.drag[a] + pores * still;
                    let free = pores + weight * sum.pushed[a];
                    (weight * sum.held[a] / drag, free / drag)
                } else {
                    let permeability = self.permeability[cell] * self.following.factor(cell);
                    let own = liquid.viscosity / permeability * ratio;
                    let own = match settings.equations {
                        Equations::Corrected => own,
                        Equations::Paper => own * self.limited[cell],
                    };
                    (0.0, 1.0 / (own + still))
                };
                water.flow[cell][a] = (carried, mobility);
                let displaced = ground.displaced / volume;
                let with = 1.0 + displaced * sum.with_flux[a];
                along[a] = with * mobility + displaced * sum.with_gradient[a];
                water.carried[cell][a] = with * carried + displaced * sum.moving[a];
                if !moves {
                    (along[a], water.carried[cell][a]) = (mobility, 0.0);
                }
            }
            // There is no flow along the axis that a 2-D scene lacks.
            let first = along[0];
            along[dimension..].fill(first);
            water.conductivity[cell] = along[0];
            water.ratios[cell] = along.map(|k| k / along[0]);
            water.directed |= along.iter().any(|k| k.total_cmp(&along[0]).is_ne());
        }
    }

    /// Computes laws and pressure alternately until both converge; returns the number of iterations. Collective.
    fn iterate_until_converged(&mut self, particles: &ParticlesView<'_, Sp>) -> Result<u32, Error> {
        let moves = self.settings.moves();
        let source = self.settings.transient_porosity && !moves && self.earlier.known;
        let mut settled = (SETTLED * self.pressure.tolerance()).max(MIN_SETTLED);
        let grains = self.communicator.all_reduce_sum_u64(particles.owned as u64);
        if moves && self.earlier.known && grains > 0 {
            settled = settled.max(CONTINUED_CHANGE);
        }
        let law = self.settings.resistance.law.model();
        let of_zones = |(zones, _): &(Arc<Zones>, ZonePermeability)| zones.depend_on_the_gradient();
        let depends =
            law.depends_on_the_gradient() && !moves || self.zones.as_ref().is_some_and(of_zones);
        self.compute_open_water_friction();
        let mut iterations = 0;
        for round in 1.. {
            if self.water.has_open {
                // The friction with which the pressure was computed is kept for its balance of momentum.
                let water = &mut self.water;
                water.still.copy_from_slice(&water.friction_next);
            }
            self.compute_permeability();
            self.sum(particles, grains)?;
            self.compute_flux_law();
            if self.water.directed {
                self.pressure.set_directions(&self.water.ratios);
            }
            self.report = self
                .pressure
                .solve(Medium {
                    conductivity: &self.water.conductivity,
                    carried: moves.then_some(&self.water.carried[..]),
                    source: source.then_some(&self.source[..]),
                })
                .map_err(failed)?;
            iterations += self.report.iterations;
            let mut change = self.update_flux();
            if depends {
                change = larger(change, self.permeability_change());
            }
            change = larger(change, self.compute_open_water_friction());
            if change <= settled || round >= STALLED_ROUNDS && change <= STALLED_CHANGE {
                break;
            }
            if round >= MAX_ROUNDS || change.is_nan() {
                return Err(Error::Numerical(self.unsettled(change, round)));
            }
        }
        if !moves {
            // The grains are subject to the computed flux.
            for (ground, flux) in self.water.ground.iter_mut().zip(&self.water.flux) {
                if let Some(ground) = ground {
                    ground.flux = *flux;
                }
            }
            self.compute_grain_motion(particles);
        }
        Ok(iterations)
    }

    /// Computes the largest relative change of the permeabilities that depend on the gradient.
    fn permeability_change(&mut self) -> f64 {
        let (law, liquid) = (self.settings.resistance.law.model(), self.settings.liquid);
        let bed = BedOfCells {
            porosity: &self.limited,
            diameter: self.pores.diameter(),
            gradient: &self.water.steepness,
        };
        match &mut self.zones {
            Some((zones, permeability_of_zones)) => permeability_of_zones.change(
                zones,
                law,
                (bed, &self.water.open),
                liquid,
                &self.permeability,
            ),
            None => law.change(bed, liquid, &self.permeability),
        }
    }

    /// Computes drag and motion of each part of a grain from the present flux.
    fn compute_grain_motion(&mut self, particles: &ParticlesView<'_, Sp>) {
        let mut shares = std::mem::take(&mut self.parts.shares);
        let (laws, ground) = (self.laws(), &self.water.ground);
        thread_pool::each_item(&mut shares, 1, |_, share| {
            bed::fill(laws, ground, particles, share)
        });
        self.parts.shares = shares;
    }

    /// Computes terms and sums of the grains, if they move with the water; `grains` is their number on all ranks.
    fn sum(&mut self, particles: &ParticlesView<'_, Sp>, grains: u64) -> Result<(), Error> {
        if !self.settings.moves() {
            return Ok(());
        }
        if grains == 0 {
            self.sums.clear();
            return Ok(());
        }
        self.compute_grain_motion(particles);
        let cells = self.openness.grid.count();
        self.sums
            .fill(cells, &self.parts.shares, &self.communicator)
            .map_err(failed)
    }

    /// Computes the flux of the water from the pressure, and the flux and speed for the next iteration; returns the
    /// largest relative change of a coefficient, weighted by the gradient or the speed of its cell relative to the
    /// largest.
    fn update_flux(&mut self) -> f64 {
        let dimension = self.openness.grid.dimension;
        for cell in 0..self.water.flow.len() {
            let gradient = self.pressure.reduced_gradient(cell);
            self.water.gradient[cell] = gradient;
            let flow = self.water.flow[cell];
            self.water.flux[cell] = std::array::from_fn(|a| {
                if a < dimension {
                    flow[a].0 - flow[a].1 * gradient[a]
                } else {
                    0.0
                }
            });
        }
        self.water.update_gradient_magnitudes();
        self.compute_weights();
        let mut change = 0.0_f64;
        let mut grounds = std::mem::take(&mut self.water.ground);
        for (cell, ground) in grounds.iter_mut().enumerate() {
            let Some(ground) = ground else { continue };
            let found = self.water.flux[cell];
            let weight = self.water.weight[cell];
            change = larger(change, weight * self.follow_grains(cell, ground, found));
            if self.water.channels.open(cell) > 0.0 {
                let (duct, used) = (self.water.channels.duct(cell, 0), self.water.speed[cell]);
                let (liquid, rough) = (self.settings.liquid, self.water.roughness);
                let slope = slope(|speed| duct.resistance(liquid, rough, speed), used);
                self.water.speed[cell] = self.water.friction[cell].next(used, norm(found), slope);
            }
        }
        self.water.ground = grounds;
        change
    }

    /// Computes the flux for the next iteration of the drag of a cell; returns the relative change of its coefficient.
    fn follow_grains(&self, cell: usize, ground: &mut Ground, found: [f64; 3]) -> f64 {
        if self.pores.solid_volume(cell) <= 0.0 || !self.settings.moves() {
            return 0.0;
        }
        let sum: &Sum = self.sums.cell(cell);
        let mean = sum.mean();
        let slip = |flux: [f64; 3]| std::array::from_fn(|a| flux[a] - mean[a]);
        let (used, new): ([f64; 3], [f64; 3]) = (slip(ground.flux), slip(found));
        let (used_speed, new_speed) = (norm(used), norm(new));
        let laws = self.laws();
        let grain = GrainSize::new(self.openness.grid.dimension, 0.5 * ground.packing.1);
        let slope = slope(|speed| laws.reaction(ground, &grain, speed), used_speed);
        let next = ground.secant.next(used_speed, new_speed, slope);
        let factor = if new_speed > 0.0 {
            next / new_speed
        } else {
            0.0
        };
        let moved: [f64; 3] = std::array::from_fn(|a| new[a] - used[a]);
        ground.flux = std::array::from_fn(|a| mean[a] + factor * new[a]);
        let here = laws.reaction(ground, &grain, used_speed);
        let nearby = laws.reaction(ground, &grain, used_speed + norm(moved));
        (nearby / here - 1.0).abs()
    }

    /// Returns the permeability of the bed of a cell at its present slip \[m2\].
    #[must_use]
    pub fn permeability(&self, cell: usize) -> f64 {
        let Some(ground) = &self.water.ground[cell] else {
            return 0.0;
        };
        let grain = GrainSize::new(self.openness.grid.dimension, 0.5 * ground.packing.1);
        let b = self.laws().reaction(ground, &grain, norm(self.slip(cell)));
        self.settings.liquid.viscosity * ground.factor * grain.volume / b
    }

    /// Returns the message of a run that ends because the coefficients do not converge.
    fn unsettled(&self, change: f64, rounds: u32) -> String {
        let weight = &self.water.weight;
        let worst = (0..weight.len())
            .max_by(|a, b| weight[*a].total_cmp(&weight[*b]))
            .unwrap_or(0);
        let grid = &self.openness.grid;
        let [x, y, z] = grid.centre(grid.cell(worst));
        format!(
            "the resistance of the water still changes by {change:.1e} after {rounds} solutions of the pressure; \
             the highest velocity is in the cell at ({x:.6}, {y:.6}, {z:.6}) m: {:.3e} m/s at a porosity of \
             {:.3}. Use a larger `fluid.darcy.tolerance` (up to 1e-4), larger cells, or a smaller \
             `fluid.darcy.coupling_interval`",
            norm(self.water.flux[worst]),
            self.pores.porosity()[worst]
        )
    }
}

/// Returns the water-filled volume of a cell inside the walls \[m³\].
pub(super) fn pores_of(openness: &Openness, porosity: &[f64], cell: usize) -> f64 {
    openness.volume(cell) * porosity[cell].max(MIN_PORES)
}
