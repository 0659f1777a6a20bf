//! [`Report`]: what was simulated, in numbers.

use serde::Serialize;
use splat_physics::{ElasticBody, StepReport};

use super::body::{Body, GroundChoice};
use super::{Options, short, triple};
use crate::capture::Capture;

/// Written as `report.json`.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    file: String,
    part: String,
    gaussians: usize,
    materials: Vec<Made>,
    metres_per_unit: f64,
    /// Whether somebody said so.
    scale_known: bool,
    /// The capture's up, in its own axes; the axes of all vectors here, lengths in metres.
    up: [f64; 3],
    ground: GroundChoice,
    /// In m^3.
    volume: f64,
    /// In kg.
    mass: f64,
    handles: usize,
    samples: usize,
    /// Of the lowest swing in Hz; 0 if nothing swings.
    frequency: f64,
    seconds: f64,
    steps: u64,
    /// Steps in which it moved at all; it sleeps when it has come to rest.
    steps_awake: u64,
    /// Newton's iterations in all.
    iterations: u64,
    /// The most points that touched something at once.
    contacts_most: usize,
    contacts_last: usize,
    /// When something was first touched, in seconds.
    first_contact: Option<f64>,
    /// At the end, in J.
    energy: Energy,
    /// The most elastic energy there was, in J.
    elastic_most: f64,
    center_first: [f64; 3],
    center_last: [f64; 3],
    /// By how much the centre of mass came down, in metres.
    fell: f64,
    status: Status,
    frames: usize,
    pub(super) notes: Vec<String>,
}

#[derive(Debug, Serialize)]
struct Made {
    name: &'static str,
    /// Which selection; that of the part where it is null.
    part: Option<String>,
}

#[derive(Debug, Default, Serialize)]
struct Energy {
    kinetic: f64,
    elastic: f64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
enum Status {
    /// It still moves.
    Moving,
    /// It has come to rest.
    Asleep,
    /// No sound step was found: it stays where it last was sound.
    Frozen,
}

impl Report {
    pub(super) fn of(options: &Options, capture: &Capture, body: &Body) -> Self {
        let model = body.elastic.model();
        let center = triple(body.elastic.center());
        Self {
            file: capture.path.display().to_string(),
            part: options.part.display().to_string(),
            gaussians: body.part.count(),
            materials: options
                .materials
                .iter()
                .map(|m| Made { name: m.name, part: m.part.as_ref().map(|p| p.display().to_string()) })
                .collect(),
            metres_per_unit: body.metres_per_unit,
            scale_known: body.scale_known,
            up: triple(body.up),
            ground: body.ground,
            volume: body.solid.volume(),
            mass: model.mass().mass,
            handles: model.handles(),
            samples: model.samples().len(),
            frequency: model.frequency(),
            seconds: 0.0,
            steps: 0,
            steps_awake: 0,
            iterations: 0,
            contacts_most: 0,
            contacts_last: 0,
            first_contact: None,
            energy: Energy::default(),
            elastic_most: 0.0,
            center_first: center,
            center_last: center,
            fell: 0.0,
            status: Status::Moving,
            frames: 0,
            notes: body.notes.clone(),
        }
    }

    /// Counts a step.
    pub(super) fn step(&mut self, dt: f64, done: &StepReport, body: &ElasticBody) {
        self.steps += 1;
        self.seconds = self.steps as f64 * dt;
        self.iterations += done.iterations as u64;
        self.elastic_most = self.elastic_most.max(done.elastic);
        if body.asleep() {
            return;
        }
        self.steps_awake += 1;
        self.contacts_last = done.contacts.len();
        self.contacts_most = self.contacts_most.max(done.contacts.len());
        if !done.contacts.is_empty() && self.first_contact.is_none() {
            self.first_contact = Some(self.seconds);
        }
    }

    /// What is known at the end.
    pub(super) fn end(&mut self, body: &Body, frames: usize) {
        let elastic = &body.elastic;
        self.energy = Energy { kinetic: elastic.kinetic_energy(), elastic: elastic.elastic_energy() };
        self.center_last = triple(elastic.center());
        let moved: f64 = (0..3).map(|k| (self.center_first[k] - self.center_last[k]) * self.up[k]).sum();
        self.fell = moved;
        self.status = if elastic.frozen() {
            self.notes.push("the simulation would have blown up: the part stays in its last sound pose".to_owned());
            Status::Frozen
        } else if elastic.asleep() {
            Status::Asleep
        } else {
            Status::Moving
        };
        self.frames = frames;
    }

    pub(super) fn text(&self) -> String {
        let n = |v: f64| short(v as f32);
        let names: Vec<&str> = self.materials.iter().map(|m| m.name).collect();
        let scale = if self.scale_known { "" } else { ", a guess" };
        let end = match self.status {
            Status::Moving => "it still moves",
            Status::Asleep => "it has come to rest",
            Status::Frozen => "it was stopped",
        };
        [
            format!("material    {}", names.join(", ")),
            format!("scale       {} metres per unit{scale}", n(self.metres_per_unit)),
            format!("body        {} litres, {} kg", n(1e3 * self.volume), n(self.mass)),
            format!("time        {} s in {} steps; {end}", n(self.seconds), self.steps),
            format!("fell by     {} m, {} points touch", n(self.fell), self.contacts_last),
        ]
        .join("\n")
    }
}
