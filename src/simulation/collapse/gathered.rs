//! The grains of all ranks in the frame of the analysis, on the first rank.

use crate::removal::{boxed, rows};
use crate::view::StateView;
use analysis::ground_collapse::measure::{MeasuredGrain, Point};
use base::error::Error;
use base::vector::norm;
use dem::space::{Components, Space};
use plan::scene::collapse::{GroundCollapse, SeepagePoint};

/// Number of values per grain: id, radius, position, displacement.
const NUMBERS: usize = 2 + 2 * 3;

/// Data from which rank 0 measures the ground.
pub(super) struct Gathered {
    /// Grains of all ranks in ascending order of ids.
    pub(super) grains: Vec<MeasuredGrain>,
    /// Ids of the two grains of each bond between loose grains.
    pub(super) bonds: Vec<[u64; 2]>,
}

/// Returns all grains and the bonds between loose ones on rank 0; none on other ranks. Collective.
pub(super) fn gather<S: Space>(
    view: &StateView<'_, S>,
    settings: &GroundCollapse,
    loose: f64,
) -> Result<Option<Gathered>, Error> {
    let grid = &view.plan.scene.grid;
    let particles = view.particles;
    let up = if settings.upright { 1.0 } else { -1.0 };
    let mut bytes = Vec::new();
    for k in 0..particles.owned() {
        let body = &particles.body[k];
        if body.id < view.plan.scene.first_grain() {
            continue;
        }
        let moved = moved(view, k);
        let at = boxed(&particles.motion[k].position, grid);
        let [x, y, z] = settings.axes;
        let height = if settings.upright {
            at[z]
        } else {
            grid.size[z] - at[z]
        };
        let numbers: [u64; NUMBERS] = [
            body.id,
            body.radius.to_bits(),
            at[x].to_bits(),
            at[y].to_bits(),
            height.to_bits(),
            moved[x].to_bits(),
            moved[y].to_bits(),
            (up * moved[z]).to_bits(),
        ];
        bytes.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
    }
    let mut bonds = Vec::new();
    if let Some(dem) = view.dem {
        dem.for_each_contact(particles, |contact| {
            // Each contact is reported once: by the rank that owns its first grain.
            if let Some(other) = contact.other
                && contact.bonded
                && norm(moved(view, contact.grain)) > loose
            {
                for k in [contact.grain, other] {
                    bonds.extend(particles.body[k].id.to_le_bytes());
                }
            }
        });
    }
    let communicator = view.domain.communicator();
    let grains = communicator.gather_bytes(0, &bytes);
    let bonds = communicator.gather_bytes(0, &bonds);
    let (Some(grains), Some(bonds)) = (grains, bonds) else {
        return Ok(None);
    };
    let mut all = Vec::new();
    for bytes in grains {
        for [id, radius, x, y, z, along, across, up] in rows::<NUMBERS>(&bytes)? {
            all.push(MeasuredGrain {
                id,
                at: [x, y, z].map(f64::from_bits),
                moved: [along, across, up].map(f64::from_bits),
                radius: f64::from_bits(radius),
            });
        }
    }
    all.sort_unstable_by_key(|grain| grain.id);
    let mut joined = Vec::new();
    for bytes in bonds {
        joined.extend(rows::<2>(&bytes)?);
    }
    Ok(Some(Gathered {
        grains: all,
        bonds: joined,
    }))
}

/// Returns the displacement of an owned grain since the start \[m\].
fn moved<S: Space>(view: &StateView<'_, S>, k: usize) -> [f64; 3] {
    let moved = view.particles.displacement(k);
    moved.map_or([0.0; 3], |moved| {
        std::array::from_fn(|axis| {
            if axis < S::DIMENSION {
                moved.get(axis)
            } else {
                0.0
            }
        })
    })
}

/// Returns the box of a seepage point in the frame of the analysis.
pub(super) fn in_frame(settings: &GroundCollapse, domain: [f64; 3], point: &SeepagePoint) -> Point {
    let turn = |corner: [f64; 3]| settings.axes.map(|axis| corner[axis]);
    let (mut from, mut to) = (turn(point.block.from), turn(point.block.to));
    if !settings.upright {
        let height = domain[settings.axes[2]];
        (from[2], to[2]) = (height - to[2], height - from[2]);
    }
    Point { from, to }
}
