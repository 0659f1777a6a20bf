//! Dense views: from where the object is looked at between the user's annotations (the paper's section 4.4.1).
//!
//! Either the training views or an evenly spaced subset of them ([`evenly_spaced`]), or a turnaround about what the annotated
//! mask shows ([`turnaround`]). Then an order for the tracker ([`Plan`]): by how much two views see of the same Gaussians.

mod order;
mod subset;
mod turnaround;
mod visibility;

pub use order::{Plan, PlanKind, chain, most_similar, ring_from};
pub use subset::evenly_spaced;
pub(crate) use turnaround::alone;
pub use turnaround::{Dropped, Turnaround, TurnaroundSettings, turnaround};
pub(crate) use visibility::within;
pub use visibility::{VISIBLE_WEIGHT, ViewSets};
