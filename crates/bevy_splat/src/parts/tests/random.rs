//! Random stories, beside a model that knows of each Gaussian only whose it is and what its bits are.

use super::*;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Gaussian {
    /// Index into [`Story::entities`]; `None`: of a despawned part.
    owner: Option<usize>,
    selected: bool,
    hidden: bool,
    locked: bool,
}

struct Story {
    app: App,
    /// The capture first, then every part's entity there ever was; which it was taken from, and its Gaussians if despawned.
    entities: Vec<(Entity, Option<usize>, Life)>,
    gaussians: Vec<Gaussian>,
    random: u64,
}

#[derive(Clone, PartialEq, Eq, Debug)]
enum Life {
    Alive,
    Despawned(Vec<usize>),
    Restored,
}

impl Story {
    fn new(seed: u64) -> Self {
        let (app, capture) = scene();
        let gaussians = vec![Gaussian { owner: Some(0), ..default() }; LEN];
        Self { app, entities: vec![(capture, None, Life::Alive)], gaussians, random: seed }
    }

    fn random(&mut self, below: usize) -> usize {
        self.random = self.random.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.random >> 33) as usize % below
    }

    fn any(&mut self, wanted: impl Fn(&(Entity, Option<usize>, Life)) -> bool) -> Option<usize> {
        let fitting: Vec<usize> = (0..self.entities.len()).filter(|&k| wanted(&self.entities[k])).collect();
        (!fitting.is_empty()).then(|| fitting[self.random(fitting.len())])
    }

    /// The nearest that lives, up the line.
    fn living(&self, mut k: usize) -> usize {
        while self.entities[k].2 != Life::Alive {
            k = self.entities[k].1.unwrap();
        }
        k
    }

    fn extract(&mut self) {
        let from = self.any(|e| e.2 == Life::Alive).unwrap();
        let part = PartId(self.random(3) as u16 + 1);
        let capture = self.entities[0].0;
        let parts = self.app.world().get::<SplatParts>(capture).unwrap();
        let of = |i: usize| parts.part_of(i).is_some_and(|p| p == part || parts.get(p).unwrap().parent() == Some(part));
        let ids: Vec<usize> = (0..LEN).filter(|&i| self.gaussians[i].owner == Some(from) && of(i)).collect();
        match extract_part(self.app.world_mut(), self.entities[from].0, part) {
            Ok(entity) => {
                assert!(!ids.is_empty());
                let k = self.entities.len();
                self.entities.push((entity, Some(from), Life::Alive));
                ids.into_iter().for_each(|i| self.gaussians[i].owner = Some(k));
            }
            Err(error) => assert!(ids.is_empty(), "{error}"),
        }
    }

    fn restore(&mut self, k: usize) {
        let to = self.living(self.entities[k].1.unwrap());
        let back = restore_part(self.app.world_mut(), self.entities[k].0);
        assert_eq!(back, Ok(self.entities[to].0));
        let ids = match std::mem::replace(&mut self.entities[k].2, Life::Restored) {
            Life::Despawned(ids) => ids,
            _ => (0..LEN).filter(|&i| self.gaussians[i].owner == Some(k)).collect(),
        };
        ids.into_iter().for_each(|i| self.gaussians[i].owner = Some(to));
    }

    fn despawn(&mut self) {
        let Some(k) = self.any(|e| e.1.is_some() && e.2 == Life::Alive) else { return };
        self.app.world_mut().despawn(self.entities[k].0);
        let ids: Vec<usize> = (0..LEN).filter(|&i| self.gaussians[i].owner == Some(k)).collect();
        ids.iter().for_each(|&i| self.gaussians[i].owner = None);
        self.entities[k].2 = Life::Despawned(ids);
    }

    /// Sets random bits of an entity, some of them of Gaussians that are not its own: these must not matter.
    fn set_bits(&mut self) {
        let k = self.any(|e| e.2 == Life::Alive).unwrap();
        let (start, count) = (self.random(LEN), self.random(90));
        let bits = Selection::from_fn(LEN, |i| (start..start + count).contains(&i));
        let which = self.random(4);
        let mut entity = self.app.world_mut().entity_mut(self.entities[k].0);
        for g in self.gaussians.iter_mut().enumerate().filter(|(_, g)| g.owner == Some(k)) {
            let (i, g) = g;
            match which {
                0 => g.selected = bits.contains(i),
                1 => g.hidden = bits.contains(i),
                2 => g.locked = bits.contains(i),
                _ => g.selected = false,
            }
        }
        match which {
            0 => {
                entity.insert(SplatSelection(bits));
            }
            1 => entity.get_mut::<SplatFlags>().unwrap().hidden = bits,
            2 => entity.get_mut::<SplatFlags>().unwrap().locked = bits,
            _ => {
                entity.remove::<SplatSelection>();
            }
        }
    }

    fn check(&mut self) {
        let world = self.app.world();
        for (k, (entity, _, life)) in self.entities.iter().enumerate() {
            assert_eq!(world.get_entity(*entity).is_ok(), *life == Life::Alive);
            if *life != Life::Alive {
                continue;
            }
            let own: Vec<u32> = (0..LEN as u32).filter(|&i| self.gaussians[i as usize].owner == Some(k)).collect();
            assert_eq!(members(world, *entity), own);
            let (_, flags, selection, _) = state(world, *entity);
            for &i in &own {
                let i = i as usize;
                let selected = selection.as_ref().is_some_and(|s| s.contains(i));
                let g = Gaussian {
                    owner: Some(k),
                    selected,
                    hidden: flags.hidden.contains(i),
                    locked: flags.locked.contains(i),
                };
                assert_eq!(g, self.gaussians[i], "Gaussian {i}");
            }
        }
    }
}

#[test]
fn whatever_happens_meanwhile_all_parts_come_back() {
    for seed in 1..=40 {
        println!("seed {seed}");
        let mut story = Story::new(seed);
        let (_, _, _, parts) = state(story.app.world(), story.entities[0].0);
        for _ in 0..60 {
            match story.random(6) {
                0 | 1 => story.extract(),
                2 => {
                    if let Some(k) = story.any(|e| e.1.is_some() && e.2 != Life::Restored) {
                        story.restore(k);
                    }
                }
                3 => story.despawn(),
                _ => story.set_bits(),
            }
            story.check();
        }
        while let Some(k) = story.any(|e| e.1.is_some() && e.2 != Life::Restored) {
            story.restore(k);
            story.check();
        }
        let (subset, _, _, after) = state(story.app.world(), story.entities[0].0);
        assert_eq!((subset, after), (None, parts), "the capture is whole again");
        assert!(story.gaussians.iter().all(|g| g.owner == Some(0)));
    }
}

#[test]
fn where_nothing_else_happens_every_bit_is_as_before() {
    for seed in 1..=20 {
        println!("seed {seed}");
        let mut story = Story::new(seed);
        for _ in 0..3 {
            story.set_bits();
        }
        let before = state(story.app.world(), story.entities[0].0);
        for _ in 0..12 {
            match story.random(4) {
                0 => story.despawn(),
                1 => {
                    if let Some(k) = story.any(|e| e.1.is_some() && e.2 != Life::Restored) {
                        story.restore(k);
                    }
                }
                _ => story.extract(),
            }
        }
        while let Some(k) = story.any(|e| e.1.is_some() && e.2 != Life::Restored) {
            story.restore(k);
        }
        assert_eq!(state(story.app.world(), story.entities[0].0), before);
    }
}
