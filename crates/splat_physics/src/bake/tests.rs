use glam::{DMat3, DQuat, DVec3, UVec3, dvec3};

use super::*;
use crate::basis::{
    BasisKind, BasisWeights, NoProgress, PartCage, SimplicitsSettings, SimplicitsState, SimplicitsTraining,
    skinning_weights,
};
use crate::{MassProperties, Material, Solid};

const OTHER: Tag = Tag(*b"OTHR");

fn material() -> Material {
    Material {
        density: 1100.0,
        youngs_modulus: 1e6,
        poisson_ratio: 0.45,
        friction_static: 0.9,
        friction_dynamic: 0.7,
        restitution: 0.6,
        damping_ratio: 0.08,
    }
}

/// A small part with everything a file can hold.
struct Part {
    part: BakedPart,
    cage: PartCage,
    weights: BasisWeights,
    mass: MassProperties,
    training: SimplicitsState,
    hulls: Vec<Vec<DVec3>>,
}

impl Part {
    fn new() -> Self {
        let mut solid = Solid::cuboid(DVec3::ZERO, dvec3(0.6, 0.4, 0.3), 0.1);
        solid.weights[0] = 0.5;
        let cage = PartCage::build(&solid, 6, 8000).unwrap();
        let kind = BasisKind::default();
        let weights = skinning_weights(&kind, &cage, &[material()], 6, 3, &NoProgress).unwrap();
        let settings = SimplicitsSettings { steps: 3, layers: 1, points: 16, motions: 1, ..Default::default() };
        let mut training = SimplicitsTraining::new(&cage, &[material()], 3, settings, 1).unwrap();
        training.step().unwrap();
        let training = training.state().clone();
        let mass = MassProperties {
            mass: 2.5,
            center: dvec3(0.1, 0.2, -0.3),
            inertia: DMat3::from_diagonal(dvec3(1.0, 2.0, 2.5)),
        };
        let part = BakedPart { key: 0x1234_5678_9abc_def0, metres_per_unit: 0.42, seed: 7 };
        let hulls = vec![vec![DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z], vec![]];
        Self { part, cage, weights, mass, training, hulls }
    }

    fn file(&self) -> Vec<u8> {
        let mut file = BakeWriter::new();
        file.put(tags::PART, &self.part);
        file.put(tags::CAGE, &self.cage);
        file.put(tags::MATERIALS, &vec![material(); 2]);
        file.put(tags::BASIS, &BasisKind::default());
        file.put(tags::WEIGHTS, &self.weights);
        file.put(tags::MASS, &self.mass);
        file.put(tags::HULLS, &self.hulls);
        file.put(tags::TRAINING, &self.training);
        file.finish()
    }
}

/// Reads all that a file may hold; whatever the bytes are, this gives answers.
fn read_all(bytes: &[u8]) -> Option<BakeError> {
    let file = match BakeReader::new(bytes) {
        Ok(file) => file,
        Err(error) => return Some(error),
    };
    let answers = [
        file.get::<BakedPart>(tags::PART).err(),
        file.get::<PartCage>(tags::CAGE).err(),
        file.get::<Vec<Material>>(tags::MATERIALS).err(),
        file.get::<BasisKind>(tags::BASIS).err(),
        file.get::<BasisWeights>(tags::WEIGHTS).err(),
        file.get::<MassProperties>(tags::MASS).err(),
        file.get::<Vec<Vec<DVec3>>>(tags::HULLS).err(),
        file.get::<SimplicitsState>(tags::TRAINING).err(),
    ];
    answers.into_iter().flatten().next()
}

/// A file with one section, whatever is in it.
fn with(tag: Tag, bytes: &[u8]) -> Vec<u8> {
    let mut file = BakeWriter::new();
    file.section(tag, |sink| sink.bytes(bytes));
    file.finish()
}

/// The bytes of a value.
fn bytes_of<T: Baked>(value: &T) -> Vec<u8> {
    let mut file = BakeWriter::new();
    file.put(OTHER, value);
    let file = file.finish();
    let mut source = BakeReader::new(&file).unwrap().section(OTHER).unwrap();
    source.bytes(source.left()).unwrap().to_vec()
}

/// xorshift64 (Marsaglia 2003).
fn next(state: &mut u64) -> u64 {
    *state ^= *state << 13;
    *state ^= *state >> 7;
    *state ^= *state << 17;
    *state
}

#[test]
fn reading_gives_the_bits_that_were_written() {
    let part = Part::new();
    let bytes = part.file();
    let file = BakeReader::new(&bytes).unwrap();
    assert_eq!(file.get::<BakedPart>(tags::PART).unwrap(), part.part);
    assert_eq!(file.get::<PartCage>(tags::CAGE).unwrap(), part.cage);
    assert_eq!(file.get::<Vec<Material>>(tags::MATERIALS).unwrap(), [material(); 2]);
    assert_eq!(file.get::<BasisKind>(tags::BASIS).unwrap(), BasisKind::default());
    assert_eq!(file.get::<BasisWeights>(tags::WEIGHTS).unwrap(), part.weights);
    assert_eq!(file.get::<MassProperties>(tags::MASS).unwrap(), part.mass);
    assert_eq!(file.get::<Vec<Vec<DVec3>>>(tags::HULLS).unwrap(), part.hulls);
    assert_eq!(file.get::<SimplicitsState>(tags::TRAINING).unwrap(), part.training);
    assert_eq!(file.tags().next(), Some(tags::PART));
    assert!(file.has(tags::MASS) && !file.has(OTHER));
    assert_eq!(file.get::<u8>(OTHER), Err(BakeError::Missing { section: OTHER }));
    assert_eq!(bytes, part.file());
}

#[test]
fn a_training_goes_on_from_a_file_with_the_bits_of_one_run() {
    let part = Part::new();
    let bytes = part.file();
    let state = BakeReader::new(&bytes).unwrap().get(tags::TRAINING).unwrap();
    let mut read = SimplicitsTraining::resume(&part.cage, &[material()], state).unwrap();
    let mut kept = SimplicitsTraining::resume(&part.cage, &[material()], part.training.clone()).unwrap();
    read.run(&NoProgress).unwrap();
    kept.run(&NoProgress).unwrap();
    assert_eq!(read.weights(), kept.weights());
}

#[test]
fn small_values_keep_their_bits() {
    fn same<T: Baked + PartialEq + std::fmt::Debug>(value: T) {
        let bytes = bytes_of(&value);
        assert!(bytes.len() >= T::LEAST, "{value:?}");
        let file = with(OTHER, &bytes);
        assert_eq!(BakeReader::new(&file).unwrap().get::<T>(OTHER).unwrap(), value);
        let longer = with(OTHER, &[bytes.clone(), vec![0]].concat());
        assert!(matches!(BakeReader::new(&longer).unwrap().get::<T>(OTHER), Err(BakeError::Long { bytes: 1, .. })));
        let shorter = with(OTHER, &bytes[..bytes.len() - 1]);
        assert!(matches!(BakeReader::new(&shorter).unwrap().get::<T>(OTHER), Err(BakeError::Short { .. })));
    }
    same((1_u8, 2_u16));
    same((u64::MAX, -3_i32));
    same((f32::MIN_POSITIVE, -0.0_f64));
    same([true, false]);
    same(Some(DVec3::NEG_ONE));
    same(None::<u32>);
    same(vec![vec![1_u32], vec![]]);
    same(DQuat::from_rotation_x(1.0));
    same(UVec3::new(1, 2, 3));
    same(DMat3::from_rotation_y(0.3));
    same(BasisKind::Affine);
    same(BasisKind::Simplicits(SimplicitsSettings::default()));
    same(material());
}

#[test]
fn nan_keeps_its_bits() {
    let bits = 0x7ff8_0000_dead_beef_u64;
    let file = with(OTHER, &bytes_of(&f64::from_bits(bits)));
    assert_eq!(BakeReader::new(&file).unwrap().get::<f64>(OTHER).unwrap().to_bits(), bits);
}

#[test]
fn a_section_of_the_same_name_takes_the_place_of_the_first() {
    let mut file = BakeWriter::new();
    file.put(OTHER, &1_u32);
    file.put(OTHER, &2_u32);
    let bytes = file.finish();
    assert_eq!(BakeReader::new(&bytes).unwrap().get::<u32>(OTHER).unwrap(), 2);
    let empty = BakeWriter::new().finish();
    assert_eq!(BakeReader::new(&empty).unwrap().tags().count(), 0);
}

#[test]
fn a_file_cut_off_anywhere_is_told() {
    let bytes = Part::new().file();
    for length in (0..bytes.len() - 8).filter(|length| length % 7 == 0 || *length < 400) {
        let error = BakeReader::new(&bytes[..length]).unwrap_err();
        let cut = matches!(error, BakeError::NotABake | BakeError::Truncated { .. });
        assert!(cut, "{length}: {error}");
    }
}

#[test]
fn a_changed_byte_is_told() {
    let bytes = Part::new().file();
    let number = |at: usize| u64::from_le_bytes(bytes[at..at + 8].try_into().unwrap()) as usize;
    let entries: Vec<usize> = (0..8).map(|k| HEADER + k * ENTRY).collect();
    let mut state = 1;
    for at in (0..bytes.len()).filter(|at| at % 11 == 0 || *at < 320) {
        let mut changed = bytes.clone();
        changed[at] ^= 1 << (next(&mut state) % 8);
        // What fills up the space between sections is nobody's; all else is under a checksum.
        let inside = |&entry: &usize| (number(entry + 8)..number(entry + 8) + number(entry + 16)).contains(&at);
        let covered = at < HEADER + 8 * ENTRY || entries.iter().any(inside);
        assert_eq!(read_all(&changed).is_some(), covered, "{at}");
    }
}

#[test]
fn other_files_are_told() {
    assert_eq!(BakeReader::new(&[]).unwrap_err(), BakeError::NotABake);
    assert_eq!(BakeReader::new(b"ply\nformat binary").unwrap_err(), BakeError::NotABake);
    let mut newer = BakeWriter::new().finish();
    newer[8] = 2;
    assert_eq!(BakeReader::new(&newer).unwrap_err(), BakeError::Version { found: 2, known: 1 });
    let mut many = BakeWriter::new().finish();
    many[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
    assert!(matches!(BakeReader::new(&many), Err(BakeError::TooManySections { found: u32::MAX, .. })));
    many[12..16].copy_from_slice(&1000_u32.to_le_bytes());
    assert!(matches!(BakeReader::new(&many), Err(BakeError::Truncated { .. })));
}

#[test]
fn lengths_are_not_believed() {
    for count in [u64::MAX, u64::MAX / 8, 1 << 60, 1 << 40, 3] {
        let file = with(OTHER, &[&count.to_le_bytes()[..], &[0; 16]].concat());
        let file = BakeReader::new(&file).unwrap();
        assert!(matches!(file.get::<Vec<f64>>(OTHER), Err(BakeError::Short { .. })));
        assert!(matches!(file.get::<Vec<Vec<u8>>>(OTHER), Err(BakeError::Short { .. })));
    }
    // A table whose checksum is right and whose bounds are not.
    for (first, length) in [(u64::MAX, 1), (0, u64::MAX), (u64::MAX, u64::MAX), (56, 1 << 40), (1 << 62, 0)] {
        let mut file = with(OTHER, &[1, 2, 3]);
        file[HEADER + 8..HEADER + 16].copy_from_slice(&first.to_le_bytes());
        file[HEADER + 16..HEADER + 24].copy_from_slice(&length.to_le_bytes());
        let checksum = xxhash_rust::xxh3::xxh3_64(&file[HEADER..HEADER + ENTRY]);
        file[16..24].copy_from_slice(&checksum.to_le_bytes());
        assert!(matches!(BakeReader::new(&file), Err(BakeError::Truncated { .. })), "{first} {length}");
    }
}

#[test]
fn hostile_sections_give_answers() {
    // Checksums keep out accidents, not people: sections with sound checksums and any bytes.
    let part = Part::new();
    let mut state = 99;
    let mut answers = 0;
    let sections = [
        bytes_of(&part.cage),
        bytes_of(&part.weights),
        bytes_of(&part.training),
        bytes_of(&part.mass),
        bytes_of(&vec![material()]),
    ];
    let names = [tags::CAGE, tags::WEIGHTS, tags::TRAINING, tags::MASS, tags::MATERIALS];
    for (bytes, tag) in sections.iter().zip(names) {
        for _ in 0..400 {
            let mut changed = bytes.clone();
            for _ in 0..1 + next(&mut state) % 4 {
                // Early bytes hold the counts.
                let at = next(&mut state) as usize
                    % if next(&mut state).is_multiple_of(2) { changed.len().min(64) } else { changed.len() };
                changed[at] = next(&mut state) as u8;
            }
            if next(&mut state).is_multiple_of(4) {
                changed.truncate(next(&mut state) as usize % bytes.len());
            }
            let file = with(tag, &changed);
            let file = BakeReader::new(&file).unwrap();
            let bad = match tag {
                tags::CAGE => file.get::<PartCage>(tag).map(|cage| cage.active_nodes().len()).is_err(),
                tags::WEIGHTS => file.get::<BasisWeights>(tag).is_err(),
                tags::TRAINING => {
                    let state = file.get::<SimplicitsState>(tag);
                    state.is_err_and(|_| true)
                        || SimplicitsTraining::resume(&part.cage, &[material()], file.get(tag).unwrap()).is_err()
                }
                tags::MASS => file.get::<MassProperties>(tag).is_err(),
                _ => file.get::<Vec<Material>>(tag).is_err(),
            };
            answers += u32::from(bad);
        }
    }
    assert!(answers > 500, "{answers}");
}

#[test]
fn random_bytes_give_answers() {
    let mut state = 5;
    for length in 0..600 {
        let mut bytes: Vec<u8> = (0..length).map(|_| next(&mut state) as u8).collect();
        assert!(read_all(&bytes).is_some());
        if length >= 16 {
            bytes[..8].copy_from_slice(&MAGIC);
            bytes[8..12].copy_from_slice(&VERSION.to_le_bytes());
            bytes[14..16].fill(0);
            assert!(read_all(&bytes).is_some());
        }
        for tag in [tags::PART, tags::CAGE, tags::WEIGHTS, tags::HULLS, tags::TRAINING] {
            let _ = read_all(&with(tag, &bytes));
        }
    }
}

#[test]
fn values_that_cannot_be_are_told() {
    fn answer<T: Baked>(bytes: &[u8]) -> Option<BakeError> {
        BakeReader::new(&with(OTHER, bytes)).unwrap().get::<T>(OTHER).err()
    }
    let unsound = |error: Option<BakeError>| matches!(error, Some(BakeError::Unsound { section: OTHER, .. }));
    assert!(unsound(answer::<bool>(&[2])));
    assert!(unsound(answer::<BasisKind>(&[3])));
    let part = Part::new();
    assert!(unsound(answer::<BakedPart>(&bytes_of(&BakedPart { metres_per_unit: f64::NAN, ..part.part }))));
    assert!(unsound(answer::<MassProperties>(&bytes_of(&MassProperties { mass: 0.0, ..part.mass }))));
    assert!(unsound(answer::<Material>(&bytes_of(&Material { density: -1.0, ..material() }))));
    let mut weights = part.weights.clone();
    weights.nodes[3] = f64::INFINITY;
    assert!(unsound(answer::<BasisWeights>(&bytes_of(&weights))));
    weights.nodes.truncate(weights.handles + 1);
    assert!(unsound(answer::<BasisWeights>(&bytes_of(&weights))));
    let cages: [fn(&mut PartCage); 6] = [
        |cage| cage.cage.cells.x += 1,
        |cage| cage.cage.cells = UVec3::ZERO,
        |cage| cage.cage.cells = UVec3::MAX,
        |cage| cage.cage.cell = f32::NAN,
        |cage| cage.fill[0] = 2.0,
        |cage| cage.active.fill(false),
    ];
    for change in cages {
        let mut cage = part.cage.clone();
        change(&mut cage);
        assert!(unsound(answer::<PartCage>(&bytes_of(&cage))));
    }
}
