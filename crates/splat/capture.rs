//! [`Capture`]: the file a command works on.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use splat_core::{Cloud, Selection};
use splat_io::ReadReport;
use splat_io::scale::ScaleBeside;

use crate::failure::Failure;
use crate::terminal::{Terminal, gaussians, grouped};

/// What the user loaded.
#[derive(Clone, Debug)]
pub(crate) struct Capture {
    /// Name of the file or folder, as given.
    pub(crate) path: PathBuf,
    /// Its Gaussians.
    pub(crate) cloud: Arc<Cloud>,
    /// What the reader found odd.
    pub(crate) report: ReadReport,
}

impl Capture {
    /// Reads a file of any format, showing progress; a scale that is kept beside it is in the cloud's source.
    ///
    /// # Errors
    /// [`Failure::Failed`] naming the file.
    pub(crate) fn read(path: &Path, terminal: &Terminal) -> Result<Self, Failure> {
        let working = terminal.progress(&format!("reading {}", path.display()), None);
        let (mut cloud, mut report) = splat_io::read(path)?;
        drop(working);
        match splat_io::scale::read_beside(path, &cloud) {
            Ok(ScaleBeside::Metres(metres)) => {
                let mut arrays = cloud.into_arrays();
                arrays.source.set_metres_per_unit(Some(metres));
                cloud = Cloud::new(arrays)?;
            }
            Ok(ScaleBeside::Stale) => report.notes.push(format!(
                "its scale was measured on other Gaussians and does not count; measure again with `splat scale`: {}",
                splat_io::scale::beside_path(path).display()
            )),
            Ok(_) => {}
            Err(error) => report.notes.push(error.to_string()),
        }
        Ok(Self { path: path.to_path_buf(), cloud: Arc::new(cloud), report })
    }

    /// As [`Capture::read`], and tells what is wrong with the Gaussians; [`Capture::oddities`] has all notes.
    ///
    /// # Errors
    /// As [`Capture::read`].
    pub(crate) fn read_and_tell(path: &Path, terminal: &Terminal) -> Result<Self, Failure> {
        let capture = Self::read(path, terminal)?;
        for note in capture.defects() {
            terminal.note(note);
        }
        Ok(capture)
    }

    /// Everything the reader found odd, as sentences.
    pub(crate) fn oddities(&self) -> Vec<String> {
        let mut notes = self.defects();
        notes.extend(self.report.notes.iter().cloned());
        notes
    }

    fn defects(&self) -> Vec<String> {
        let r = &self.report;
        let mut notes = Vec::new();
        if r.not_finite > 0 {
            notes.push(format!(
                "{} with NaN or infinite values will not be drawn; `splat check --repair` drops them",
                gaussians(r.not_finite)
            ));
        }
        if r.bad_rotations > 0 {
            notes.push(format!("{} without a rotation are drawn unrotated", gaussians(r.bad_rotations)));
        }
        if r.trailing_bytes > 0 {
            notes.push(format!("{} bytes after the last Gaussian were ignored", grouped(r.trailing_bytes as usize)));
        }
        notes
    }

    /// A selection of this capture from a `.npy` file with one 0 or 1 per Gaussian.
    ///
    /// # Errors
    /// [`Failure::Failed`] if the file cannot be read or has another length.
    pub(crate) fn selection(&self, path: &Path) -> Result<Selection, Failure> {
        let bits = splat_io::npy::read_u8(path)?;
        if bits.len() != self.cloud.len() {
            return Err(Failure::failed(format!(
                "the selection has {} entries but the capture {}; take the selection made from this file: {}",
                grouped(bits.len()),
                gaussians(self.cloud.len()),
                path.display()
            )));
        }
        Ok(Selection::from_fn(bits.len(), |i| bits[i] != 0))
    }
}

/// Writes a selection as a `.npy` file of one byte per Gaussian, 0 or 1.
///
/// # Errors
/// [`Failure::Failed`] naming the file.
pub(crate) fn write_selection(path: &Path, selection: &Selection) -> Result<(), Failure> {
    let bits: Vec<u8> = (0..selection.len()).map(|i| u8::from(selection.contains(i))).collect();
    Ok(splat_io::npy::write_u8(path, &bits)?)
}
