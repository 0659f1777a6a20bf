//! [`Job`]: work that sets a body up on another thread, with its progress, ended when nobody waits for it any more.

use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use bevy::prelude::*;
use bevy::tasks::futures::check_ready;
use bevy::tasks::{AsyncComputeTaskPool, Task};

use super::status::PartPhysicsError;

/// How far work is, and whether anybody still waits for it. Shared by the work and by who waits.
#[derive(Clone, Debug, Default)]
pub(super) struct Watch(Arc<Shared>);

#[derive(Debug, Default)]
struct Shared {
    /// Bits of a fraction from 0 to 1.
    fraction: AtomicU32,
    cancelled: AtomicBool,
}

impl Watch {
    /// Tells how much is done, 0 to 1.
    pub(super) fn tell(&self, fraction: f32) {
        self.0.fraction.store(fraction.clamp(0.0, 1.0).to_bits(), Ordering::Relaxed);
    }

    /// How much is done, 0 to 1.
    pub(super) fn fraction(&self) -> f32 {
        f32::from_bits(self.0.fraction.load(Ordering::Relaxed))
    }

    /// Whether the result is not wanted any more.
    pub(super) fn cancelled(&self) -> bool {
        self.0.cancelled.load(Ordering::Relaxed)
    }

    /// Asks the work to stop.
    fn cancel(&self) {
        self.0.cancelled.store(true, Ordering::Relaxed);
    }
}

/// Work of kind `K` for an entity: its component for as long as it runs. To remove it, to insert another, or to despawn the
/// entity cancels the work.
#[derive(Component)]
pub(super) struct Job<K: JobKind> {
    task: Task<Result<K::Output, PartPhysicsError>>,
    watch: Watch,
    kind: PhantomData<fn() -> K>,
}

/// What a [`Job`] gives. A type of its own for each, so that one entity can have several.
pub(super) trait JobKind: Send + Sync + 'static {
    /// The result.
    type Output: Send + 'static;
}

impl<K: JobKind> Job<K> {
    /// Begins work on Bevy's pool for long computations.
    pub(super) fn start(work: impl FnOnce(&Watch) -> Result<K::Output, PartPhysicsError> + Send + 'static) -> Self {
        let watch = Watch::default();
        let watched = watch.clone();
        let task = AsyncComputeTaskPool::get().spawn(async move { work(&watched) });
        Self { task, watch, kind: PhantomData }
    }

    /// How much is done, 0 to 1.
    pub(super) fn fraction(&self) -> f32 {
        self.watch.fraction()
    }

    /// The result, once; the job is to be removed then.
    pub(super) fn poll(&mut self) -> Option<Result<K::Output, PartPhysicsError>> {
        check_ready(&mut self.task)
    }
}

impl<K: JobKind> Drop for Job<K> {
    fn drop(&mut self) {
        self.watch.cancel();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::mpsc::channel;
    use std::time::{Duration, Instant};

    use super::*;
    use crate::testing;

    struct Counting;

    impl JobKind for Counting {
        type Output = u32;
    }

    fn wait_until(mut done: impl FnMut() -> bool) {
        let start = Instant::now();
        while !done() {
            assert!(start.elapsed() < Duration::from_secs(60), "it never came");
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    #[test]
    fn a_job_tells_how_far_it_is_and_then_its_result() {
        let _app = testing::app();
        let (go, wait) = channel::<()>();
        let mut job = Job::<Counting>::start(move |watch| {
            watch.tell(0.5);
            wait.recv().unwrap();
            watch.tell(7.0);
            Ok(42)
        });
        wait_until(|| job.fraction() == 0.5);
        assert!(job.poll().is_none());
        go.send(()).unwrap();
        let mut result = None;
        wait_until(|| {
            result = job.poll();
            result.is_some()
        });
        assert!(matches!(result, Some(Ok(42))));
        assert_eq!(job.fraction(), 1.0);
    }

    #[test]
    fn a_job_ends_with_its_entity_with_its_component_and_when_another_replaces_it() {
        let mut app = testing::app();
        let (told, tells) = channel();
        let next = || tells.recv_timeout(Duration::from_secs(60)).unwrap();
        let endless = |name: &'static str| {
            let told = told.clone();
            let job = Job::<Counting>::start(move |watch| {
                told.send((name, "began")).unwrap();
                while !watch.cancelled() {
                    std::thread::sleep(Duration::from_millis(1));
                }
                told.send((name, "ended")).unwrap();
                Ok(0)
            });
            assert_eq!(next(), (name, "began"));
            job
        };
        let world = app.world_mut();
        let entity = world.spawn(endless("removed")).id();
        world.entity_mut(entity).remove::<Job<Counting>>();
        assert_eq!(next(), ("removed", "ended"));
        let entity = world.spawn(endless("despawned")).id();
        world.despawn(entity);
        assert_eq!(next(), ("despawned", "ended"));
        let entity = world.spawn(endless("replaced")).id();
        world.entity_mut(entity).insert(Job::<Counting>::start(|_| Ok(1)));
        assert_eq!(next(), ("replaced", "ended"));
    }
}
