//! Options that need water, space or grains which a run does not have.

use super::{PictureOptions, size_of_case};
use base::error::Error;
use std::path::Path;

/// Refuses options that need water or space which the run does not have.
pub(super) fn check_water(request: &PictureOptions, water: bool, run: &Path) -> Result<(), Error> {
    let needs = [
        ("--field", request.field.is_some()),
        ("--streamlines", request.streamlines),
        ("--flow-net", request.flow_net.is_some()),
    ];
    if let Some((option, _)) = needs.iter().find(|(_, given)| *given && !water) {
        return Err(Error::Usage(format!(
            "{option}: {} contains no fluid.xmf with outputs of the water; omit the option, or set output.fluid and \
             run the case again",
            run.display()
        )));
    }
    if request.section.is_some() && size_of_case(run).is_some_and(|size| size.len() == 2) {
        return Err(Error::Usage(format!(
            "--section: the run in {} is plane, so that there is nothing to cut; omit the option",
            run.display()
        )));
    }
    Ok(())
}

/// Refuses options that need grains or blocks which the run does not have.
pub(super) fn check_grains(
    request: &PictureOptions,
    [grains, blocks]: [bool; 2],
    run: &Path,
) -> Result<(), Error> {
    let needs = [
        (
            "--arrows",
            request.arrows.is_some() && !grains,
            "grains.xmf",
        ),
        (
            "--colour",
            request.colour.is_some() && !grains && !blocks,
            "grains.xmf or blocks.xmf",
        ),
    ];
    match needs.iter().find(|(_, missing, _)| *missing) {
        None => Ok(()),
        Some((option, _, file)) => Err(Error::Usage(format!(
            "{option}: {} contains no {file} with outputs; omit the option",
            run.display()
        ))),
    }
}
