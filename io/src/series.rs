//! A series of outputs: data files `fluid_000000100.vtkhdf` and one index `fluid.xmf`.
//!
//! A data file is complete before an index names it. The index is rewritten and renamed into place as a whole at
//! every output, so that a viewer may reload it at any time. Steps without cells are omitted from the index. There
//! is no index before the first step with cells.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::atomic;
use crate::data::check_name;
use crate::error::Result;
use crate::group::{Group, on_root};
use crate::hdf::Mode;
use crate::image::{self, Image};
use crate::mesh::{self, MeshData};
use crate::moment::OutputTime;
use crate::plain;
use crate::xdmf;

/// Steps of one kind of output. Rank 0 stores them; the other ranks only take part in collective calls.
#[derive(Clone, Debug)]
pub struct Series {
    folder: PathBuf,
    name: String,
    steps: Vec<Step>,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
struct Step {
    when: OutputTime,
    /// The `<Grid>` element.
    grid: String,
}

const HEAD: &str = "<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<Xdmf Version=\"3.0\"><Domain>\n";
const XDMF_END: &str = " </Grid>\n</Domain></Xdmf>\n";

impl Series {
    /// Starts an empty series: an index and data files of an earlier run with this name are removed.
    ///
    /// # Errors
    /// If the system refuses an operation, or if the name is not lower_snake ([`crate::Error::Invalid`]).
    pub fn create(folder: &Path, name: &str, group: &dyn Group) -> Result<Self> {
        check_name(name)?;
        let mut series = Self::empty(folder, name);
        on_root(group, || {
            atomic::remove_if_there(&series.index())?;
            series
                .data_files()?
                .iter()
                .try_for_each(|(_, path)| atomic::remove_if_there(path))
        })?;
        series.steps.clear();
        Ok(series)
    }

    /// Continues a series: its index is read, or rebuilt from the data files if they do not match.
    ///
    /// # Errors
    /// If the system refuses an operation, or if the name is not lower_snake ([`crate::Error::Invalid`]).
    pub fn open(folder: &Path, name: &str, group: &dyn Group) -> Result<Self> {
        check_name(name)?;
        let mut series = Self::empty(folder, name);
        on_root(group, || {
            match series.read_index() {
                Some(steps) => series.steps = steps,
                None => series.scan()?,
            }
            Ok(())
        })?;
        Ok(series)
    }

    fn empty(folder: &Path, name: &str) -> Self {
        Self {
            folder: folder.to_owned(),
            name: name.to_owned(),
            steps: Vec::new(),
        }
    }

    /// Returns the index file.
    #[must_use]
    pub fn index(&self) -> PathBuf {
        self.folder.join(format!("{}.xmf", self.name))
    }

    /// Returns the path of the data file of a step.
    #[must_use]
    pub fn data_path(&self, step: u64) -> PathBuf {
        self.folder.join(format!("{}_{step:09}.vtkhdf", self.name))
    }

    /// Returns the steps written so far, in order, unless none of them contains cells; only rank 0 knows them.
    pub fn moments(&self) -> impl Iterator<Item = OutputTime> + '_ {
        let any = self.steps.iter().any(|step| xdmf::has_cells(&step.grid));
        let steps = self.steps.iter().filter(move |_| any);
        steps.map(|step| step.when)
    }

    /// Writes one output of a lattice and the index. Called by all ranks; returns the path of the data file.
    ///
    /// # Errors
    /// If [`crate::hdf::write`] fails; the index is then unchanged.
    pub fn write_image(
        &mut self,
        when: OutputTime,
        image: &Image,
        provenance: &[(String, String)],
        group: &dyn Group,
        mode: Mode,
    ) -> Result<PathBuf> {
        let path = self.data_path(when.step);
        image::write(&path, when, image, provenance, group, mode)?;
        self.add(path, group)
    }

    /// Writes one output of a mesh and the index. Called by all ranks; returns the path of the data file.
    ///
    /// # Errors
    /// If [`crate::hdf::write`] fails; the index is then unchanged.
    pub fn write_mesh(
        &mut self,
        when: OutputTime,
        mesh: &MeshData,
        provenance: &[(String, String)],
        group: &dyn Group,
        mode: Mode,
    ) -> Result<PathBuf> {
        let path = self.data_path(when.step);
        mesh::write(&path, when, mesh, provenance, group, mode)?;
        self.add(path, group)
    }

    fn add(&mut self, path: PathBuf, group: &dyn Group) -> Result<PathBuf> {
        on_root(group, || {
            let (when, grid) = xdmf::grid(&path)?;
            let at = self.steps.partition_point(|s| s.when.step < when.step);
            let step = Step { when, grid };
            match self.steps.get_mut(at) {
                Some(old) if old.when.step == when.step => *old = step,
                _ => self.steps.insert(at, step),
            }
            self.write_index()
        })?;
        Ok(path)
    }

    /// Removes every step after `step` with its data files, before a restart writes them again. Called by all
    /// ranks.
    ///
    /// # Errors
    /// If the system refuses an operation.
    pub fn truncate_after(&mut self, step: u64, group: &dyn Group) -> Result<()> {
        on_root(group, || {
            self.steps.retain(|s| s.when.step <= step);
            // The index is written first, so that it never names a removed file.
            self.write_index()?;
            for (late, path) in self.data_files()? {
                if late > step {
                    atomic::remove_if_there(&path)?;
                }
            }
            Ok(())
        })
    }

    fn write_index(&self) -> Result<()> {
        if self.moments().next().is_none() {
            return atomic::remove_if_there(&self.index());
        }
        let mut text = String::from(HEAD);
        text.push_str(&self.collection());
        for step in &self.steps {
            text.push_str(&step.grid);
        }
        text.push_str(XDMF_END);
        atomic::write(&self.index(), text.as_bytes())
    }

    fn collection(&self) -> String {
        format!(
            " <Grid Name=\"{}\" GridType=\"Collection\" CollectionType=\"Temporal\">\n",
            self.name
        )
    }

    /// Returns the steps of the index, or nothing if it is missing, has another form, or does not match the data
    /// files.
    fn read_index(&self) -> Option<Vec<Step>> {
        let text = plain::text(&self.index(), plain::LONGEST_TABLE).ok()?;
        let body = text
            .strip_prefix(HEAD)?
            .strip_prefix(&self.collection())?
            .strip_suffix(XDMF_END)?;
        let end = "  </Grid>\n";
        let mut steps = Vec::new();
        for grid in body.split_inclusive(end) {
            let line = grid
                .strip_prefix("  <Grid Name=\"")?
                .strip_prefix(self.name.as_str())?
                .strip_prefix('_')?;
            let (step, rest) = line.split_once("\" GridType=\"Uniform\"><Time Value=\"")?;
            let (time, _) = rest.split_once("\"/>")?;
            steps.push(Step {
                when: OutputTime {
                    step: step.parse().ok()?,
                    time: time.parse().ok()?,
                },
                grid: grid.to_owned(),
            });
        }
        let named = steps.iter().all(|s| self.data_path(s.when.step).is_file());
        named.then_some(steps)
    }

    fn scan(&mut self) -> Result<()> {
        self.steps.clear();
        for (step, path) in self.data_files()? {
            match xdmf::grid(&path) {
                Ok((when, grid)) if when.step == step => self.steps.push(Step { when, grid }),
                Ok((when, _)) => {
                    log::warn!(
                        "{} is left out: it holds step {}",
                        path.display(),
                        when.step
                    );
                }
                Err(error) => log::warn!("left out of {}: {error}", self.index().display()),
            }
        }
        self.steps.sort_by_key(|s| s.when.step);
        Ok(())
    }

    fn data_files(&self) -> Result<Vec<(u64, PathBuf)>> {
        let number = |path: &PathBuf| -> Option<u64> {
            path.file_name()?
                .to_str()?
                .strip_prefix(self.name.as_str())?
                .strip_prefix('_')?
                .strip_suffix(".vtkhdf")?
                .parse()
                .ok()
        };
        Ok(atomic::files(&self.folder)?
            .into_iter()
            .filter_map(|path| Some((number(&path)?, path)))
            .collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Alone, Cells, Column, Data};

    fn mesh(points: &[f64]) -> MeshData<'_> {
        MeshData {
            points: Data::F64(points),
            cells: Cells::Vertices,
            point_columns: vec![],
            cell_columns: vec![],
        }
    }

    fn put(series: &mut Series, step: u64, points: &[f64]) -> PathBuf {
        let when = OutputTime {
            step,
            time: f64::from(u32::try_from(step).unwrap()) / 1e7,
        };
        series
            .write_mesh(when, &mesh(points), &[], &Alone, Mode::Collective)
            .unwrap()
    }

    fn steps(series: &Series) -> Vec<u64> {
        series.moments().map(|m| m.step).collect()
    }

    #[test]
    fn a_series_grows_is_read_back_and_cut() {
        let dir = tempfile::tempdir().unwrap();
        let mut series = Series::create(dir.path(), "particles", &Alone).unwrap();
        put(&mut series, 0, &[]);
        assert!(!series.index().exists());
        for step in [100, 200, 300] {
            let path = put(&mut series, step, &[0.0, 1.0, 2.0]);
            assert!(path.ends_with(format!("particles_{step:09}.vtkhdf")));
        }
        let text = std::fs::read_to_string(series.index()).unwrap();
        assert!(text.contains("<Time Value=\"1e-5\"/>"), "{text}");
        assert!(text.contains(
            "NumberType=\"Float\" Precision=\"8\" Dimensions=\"1 3\">particles_000000100.vtkhdf:/VTKHDF/Points"
        ));

        let mut again = Series::open(dir.path(), "particles", &Alone).unwrap();
        assert_eq!(
            again.moments().collect::<Vec<_>>(),
            series.moments().collect::<Vec<_>>()
        );
        again.truncate_after(200, &Alone).unwrap();
        assert_eq!(steps(&again), vec![0, 100, 200]);
        assert!(!again.data_path(300).exists() && again.data_path(0).exists());

        // The same index from the heavy files alone.
        let kept = std::fs::read_to_string(again.index()).unwrap();
        std::fs::remove_file(again.index()).unwrap();
        let mut rebuilt = Series::open(dir.path(), "particles", &Alone).unwrap();
        rebuilt.truncate_after(200, &Alone).unwrap();
        assert_eq!(std::fs::read_to_string(rebuilt.index()).unwrap(), kept);

        // A step that is written twice occurs once.
        put(&mut again, 200, &[1.0, 1.0, 1.0]);
        assert_eq!(steps(&again), vec![0, 100, 200]);
        again.truncate_after(50, &Alone).unwrap();
        assert!(!again.index().exists());
        let fresh = Series::create(dir.path(), "particles", &Alone).unwrap();
        assert!(!fresh.data_path(0).exists());
    }

    /// Checks that the index does not show the step before one without cells in its place.
    #[test]
    fn a_step_without_cells_is_in_the_index() {
        let dir = tempfile::tempdir().unwrap();
        let mut series = Series::create(dir.path(), "particles", &Alone).unwrap();
        for (step, points) in [(1, &[0.0; 3][..]), (2, &[]), (3, &[1.0; 3])] {
            let radii = vec![0.5; points.len() / 3];
            let mut mesh = mesh(points);
            mesh.point_columns = vec![Column {
                name: "radius",
                units: "m",
                components: 1,
                data: Data::F64(&radii),
            }];
            let when = OutputTime { step, time: 0.1 };
            series
                .write_mesh(when, &mesh, &[], &Alone, Mode::Collective)
                .unwrap();
        }
        assert_eq!(steps(&series), vec![1, 2, 3]);
        let text = std::fs::read_to_string(series.index()).unwrap();
        let empty = text.split("<Grid Name=").nth(3).unwrap();
        assert!(empty.contains("particles_000000002"), "{empty}");
        assert!(
            empty.contains("NumberOfElements=\"0\"") && empty.contains("\"radius\""),
            "{empty}"
        );
        let again = Series::open(dir.path(), "particles", &Alone).unwrap();
        assert_eq!(steps(&again), vec![1, 2, 3]);
    }

    #[test]
    fn an_index_that_does_not_fit_its_files_is_made_anew() {
        let dir = tempfile::tempdir().unwrap();
        let mut series = Series::create(dir.path(), "bonds", &Alone).unwrap();
        for step in [1, 2] {
            put(&mut series, step, &[0.0; 3]);
        }
        std::fs::write(series.index(), "<Xdmf>").unwrap();
        assert_eq!(
            steps(&Series::open(dir.path(), "bonds", &Alone).unwrap()),
            vec![1, 2]
        );
        let mut anew = Series::open(dir.path(), "bonds", &Alone).unwrap();
        anew.truncate_after(2, &Alone).unwrap();
        std::fs::remove_file(series.data_path(1)).unwrap();
        assert_eq!(
            steps(&Series::open(dir.path(), "bonds", &Alone).unwrap()),
            vec![2]
        );
        std::fs::write(series.data_path(2), "no").unwrap();
        assert_eq!(
            steps(&Series::open(dir.path(), "bonds", &Alone).unwrap()),
            Vec::<u64>::new()
        );
        assert!(Series::open(dir.path(), "Bonds", &Alone).is_err());
    }
}
