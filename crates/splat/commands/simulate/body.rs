//! [`Body`]: the part in motion, and what it falls on.

use std::sync::Arc;

use splat_core::deform::{Cage, Deformation};
use splat_core::glam::{DVec3, Vec3};
use splat_core::orient::{self, Floor, FloorSettings};
use splat_core::{Cloud, SelectMode, Selection, Similarity};
use splat_physics::world::{Contact, ContactWorld, PlaneWorld};
use splat_physics::{
    BasisKind, DistanceField, ElasticBody, ElasticModel, ElasticSettings, Frame, Ground, GroundSettings, Loads,
    Material, NoProgress, Solid, SolidSettings,
};

use super::{Options, Report};
use crate::capture::Capture;
use crate::failure::Failure;
use crate::terminal::Terminal;

/// Standard gravity, in m/s^2.
const GRAVITY: f64 = 9.81;
/// Stiffer bodies bend by nothing that could be seen: they move as one, and this stiffness keeps them in shape. In Pa.
const STIFFEST: f32 = 1e8;

/// What a part falls on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub(super) enum GroundChoice {
    /// The plane of what it stands on, else that of the floor, else the surface
    Auto,
    /// The surface of all that is left of the capture, holes below the part closed
    Surface,
    /// The plane of what it stands on, such as a table's top
    Stand,
    /// The plane of the floor
    Floor,
    /// Nothing: it falls for ever
    None,
}

/// The part as a body, and its surroundings. The world is the cloud's space in metres.
pub(super) struct Body {
    /// What it was made of.
    pub(super) part: Selection,
    pub(super) solid: Solid,
    pub(super) elastic: ElasticBody,
    pub(super) metres_per_unit: f64,
    pub(super) scale_known: bool,
    pub(super) ground: GroundChoice,
    pub(super) up: DVec3,
    pub(super) notes: Vec<String>,
    world: World,
}

enum World {
    Plane(PlaneWorld),
    Field(Box<DistanceField>),
    Empty,
}

impl ContactWorld for World {
    fn contacts(&mut self, points: &[DVec3], reach: f64, out: &mut Vec<Contact>) {
        match self {
            Self::Plane(plane) => plane.contacts(points, reach, out),
            Self::Field(field) => field.contacts(points, reach, out),
            Self::Empty => {}
        }
    }
}

impl Body {
    /// Makes the part a body.
    ///
    /// # Errors
    /// [`Failure`], in a sentence, if there is no such part or no body can be made of it.
    pub(super) fn build(options: &Options, capture: &Capture, up: Vec3, terminal: &Terminal) -> Result<Self, Failure> {
        let cloud = &capture.cloud;
        let part = capture.selection(&options.part)?;
        if part.count() == 0 {
            return Err(Failure::failed(format!("the part is empty; select something: {}", options.part.display())));
        }
        let mut notes = Vec::new();
        let metres = metres_per_unit(options, cloud, &part, up)?;
        let scale_known = metres.is_some();
        if !scale_known {
            notes.push(
                "nobody said how large the capture is: a unit counts as a metre; `splat scale` measures it".to_owned(),
            );
        }
        let metres = metres.unwrap_or(1.0);
        let ids = part.ids();
        let (materials, regions) = regions(options, capture, &ids, &mut notes)?;

        let working = terminal.progress("filling the part", None);
        let settings =
            SolidSettings { up: up.as_dvec3(), hollow: options.hollow.map(f64::from), ..SolidSettings::default() };
        let solid = Solid::build(cloud, &ids, metres, regions.as_deref(), &settings)?;
        solid.checked_mass_properties(&materials)?;
        notes.extend(solid.report.notes().map(|note| note.to_string()));
        drop(working);

        let working = terminal.progress("looking for what it falls on", None);
        let (world, ground) = world(options, cloud, &part, metres, up, &materials[0], &mut notes)?;
        drop(working);

        let working = terminal.progress("preparing the body", None);
        let elastic = materials.iter().any(Material::elastic);
        let soft: Vec<Material> =
            materials.iter().map(|m| Material { youngs_modulus: m.youngs_modulus.min(STIFFEST), ..*m }).collect();
        let kind = if elastic { BasisKind::default() } else { BasisKind::Affine };
        let settings =
            ElasticSettings { basis: kind, handles: options.handles, seed: options.seed, ..ElasticSettings::default() };
        let model = ElasticModel::build(&solid, &soft, &settings, &NoProgress)?;
        if !elastic {
            notes.push("it is stiff: it moves as one piece and does not bend".to_owned());
        }
        let lift = up.as_dvec3() * f64::from(options.lift);
        let frame = Frame { translation: lift, ..Frame::IDENTITY };
        let mut elastic = ElasticBody::new(Arc::new(model), frame);
        elastic.kick(options.velocity.as_dvec3(), DVec3::ZERO);
        drop(working);
        Ok(Self { part, solid, elastic, metres_per_unit: metres, scale_known, ground, up: up.as_dvec3(), notes, world })
    }

    /// Moves on by `dt` seconds.
    pub(super) fn step(&mut self, dt: f64, report: &mut Report) {
        let loads = Loads { gravity: -GRAVITY * self.up, springs: &[] };
        let done = self.elastic.step(dt, &loads, &mut self.world);
        report.step(dt, &done, &self.elastic);
    }

    /// How the part is bent, in the cloud's space.
    pub(super) fn deformation(&self) -> Result<Deformation, Failure> {
        let metres = &self.elastic.model().cage().cage;
        let units = (1.0 / self.metres_per_unit) as f32;
        let cage = Cage { origin: metres.origin * units, cell: metres.cell * units, cells: metres.cells };
        let mut nodes = Vec::new();
        self.elastic.node_positions(&mut nodes);
        nodes.iter_mut().for_each(|node| *node *= units);
        Ok(Deformation::new(cage, nodes)?)
    }

    /// Where the bent part is, in the cloud's space.
    pub(super) fn placed(&self) -> Similarity {
        let Frame { rotation, translation } = self.elastic.frame();
        Similarity {
            rotation: rotation.as_quat().normalize(),
            scale: 1.0,
            translation: (translation / self.metres_per_unit).as_vec3(),
        }
    }

    /// The Gaussians of the part as they lie now.
    ///
    /// # Errors
    /// [`Failure::Failed`] if the pose is none; a body that is stopped keeps its last sound one.
    pub(super) fn pose(&self, cloud: &Cloud) -> Result<Cloud, Failure> {
        let rest = cloud.pick(&self.part.ids());
        let mut arrays = rest.deformed(&self.deformation()?).transformed(&self.placed()).into_arrays();
        if self.scale_known {
            arrays.source.set_metres_per_unit(Some(self.metres_per_unit));
        }
        Ok(Cloud::new(arrays)?)
    }
}

/// The scale, as far as anybody told.
fn metres_per_unit(options: &Options, cloud: &Cloud, part: &Selection, up: Vec3) -> Result<Option<f64>, Failure> {
    let extent =
        |direction: Vec3| orient::extent_along(cloud, Some(part), direction).map_or(0.0, |(low, high)| high - low);
    let (units, metres) = if let Some(metres) = options.height {
        (extent(up), metres)
    } else if let Some(metres) = options.length {
        let axes = orient::principal_axes(cloud, Some(part));
        (axes.map_or(0.0, |a| a.axes.into_iter().map(extent).fold(0.0, f32::max)), metres)
    } else if let Some(metres) = options.metres_per_unit {
        return Ok(Some(f64::from(metres)));
    } else {
        return Ok(cloud.source().metres_per_unit());
    };
    if units > 0.0 {
        Ok(Some(f64::from(metres) / f64::from(units)))
    } else {
        Err(Failure::failed("the part has no extent to be measured; select more of it, or say --metres-per-unit"))
    }
}

/// The materials, that of the part first, and for each of the part's Gaussians which one.
fn regions(
    options: &Options,
    capture: &Capture,
    ids: &[u32],
    notes: &mut Vec<String>,
) -> Result<(Vec<Material>, Option<Vec<u8>>), Failure> {
    let mut materials: Vec<Material> =
        options.materials.iter().filter(|m| m.part.is_none()).map(|m| m.material).collect();
    let mut regions = vec![0u8; ids.len()];
    for made in &options.materials {
        let Some(path) = &made.part else { continue };
        let region = u8::try_from(materials.len())
            .map_err(|_| Failure::usage("a part can have at most 256 materials; join some of them"))?;
        let of = capture.selection(path)?;
        let inside = ids.iter().zip(&mut regions).filter(|(id, _)| of.contains(**id as usize));
        let count = inside.map(|(_, r)| *r = region).count();
        if count == 0 {
            notes.push(format!(
                "nothing of the part is selected there, so {} is not used: {}",
                made.name,
                path.display()
            ));
        }
        materials.push(made.material);
    }
    let nested = materials.len() > 1;
    Ok((materials, nested.then_some(regions)))
}

fn world(
    options: &Options,
    cloud: &Cloud,
    part: &Selection,
    metres: f64,
    up: Vec3,
    material: &Material,
    notes: &mut Vec<String>,
) -> Result<(World, GroundChoice), Failure> {
    let mut rest = Selection::all(cloud.len());
    rest.apply(SelectMode::Subtract, part);
    let friction = [f64::from(material.friction_dynamic), f64::from(material.friction_static)];
    let restitution = f64::from(material.restitution);
    let settings = FloorSettings { seed: options.seed, ..FloorSettings::default() };
    let on = |floor: Floor| {
        let (normal, offset) = (floor.normal.as_dvec3().normalize(), f64::from(floor.offset) * metres);
        World::Plane(PlaneWorld { normal, offset, friction, restitution })
    };
    let floor = || orient::floor_plane(cloud, Some(&rest), up, &settings).map(on);
    let stand = || {
        let below = below(cloud, part, &rest, up)?;
        let found = orient::surface_plane(cloud, &below, up, &settings)?;
        // What is steeper carries nothing, and a plane of a few Gaussians is none.
        (found.plane.normal.dot(up) > 0.9 && found.plane.share > 0.3).then(|| on(found.plane))
    };
    let surface = || {
        let settings = GroundSettings { up: up.as_dvec3(), ..GroundSettings::default() };
        let ground = Ground::build(cloud, &rest.ids(), &[&part.ids()], metres, &settings)?;
        let mut field = ground.field();
        (field.friction, field.restitution) = (friction, restitution);
        Ok::<_, Failure>((World::Field(Box::new(field)), GroundChoice::Surface))
    };
    let no_floor =
        "no plane has the rest of the capture on one side; choose --ground none, or turn it with `splat orient`";
    let no_stand = "there is no level surface below the part; choose --ground floor or none";
    match options.ground {
        GroundChoice::None => Ok((World::Empty, GroundChoice::None)),
        GroundChoice::Surface => surface(),
        GroundChoice::Floor => floor().map(|w| (w, GroundChoice::Floor)).ok_or_else(|| Failure::failed(no_floor)),
        GroundChoice::Stand => stand().map(|w| (w, GroundChoice::Stand)).ok_or_else(|| Failure::failed(no_stand)),
        GroundChoice::Auto => {
            if let Some(world) = stand() {
                return Ok((world, GroundChoice::Stand));
            }
            if let Some(world) = floor() {
                notes.push("there is no level surface below the part: it falls on the plane of the floor".to_owned());
                return Ok((world, GroundChoice::Floor));
            }
            surface()
        }
    }
}

/// What of the rest lies around the part's underside: within a half of its width beside it and a third of its height above and
/// below. `None`: hardly anything.
fn below(cloud: &Cloud, part: &Selection, rest: &Selection, up: Vec3) -> Option<Selection> {
    let (side, other) = up.any_orthonormal_pair();
    let extent = |direction: Vec3| orient::extent_along(cloud, Some(part), direction);
    let within = |direction: Vec3| {
        let (low, high) = extent(direction)?;
        let rim = 0.5 * (high - low);
        Some((direction, low - rim, high + rim))
    };
    let (low, high) = extent(up)?;
    let reach = 0.35 * (high - low);
    let slabs = [within(side)?, within(other)?, (up, low - reach, low + reach)];
    let near = |i: usize| {
        let mean = cloud.means()[i];
        rest.contains(i) && slabs.iter().all(|&(d, from, to)| (from..=to).contains(&d.dot(mean)))
    };
    let found = Selection::from_fn(cloud.len(), near);
    (found.count() >= 30).then_some(found)
}
