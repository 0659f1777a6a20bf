use glam::DVec3;

use super::{cuboid, elastic, model};
use crate::BakedPart;
use crate::elastic::{ElasticBody, ElasticModel, ElasticSettings, Frame, Loads};
use crate::world::EmptyWorld;

#[test]
fn a_part_read_from_its_file_moves_with_the_same_bits() {
    let settings = ElasticSettings { handles: 6, cage_cells: 8, contact_points: 40, ..ElasticSettings::default() };
    let solid = cuboid(DVec3::new(0.3, 0.2, 0.1), 0.02);
    let made = model(&solid, &[elastic(1e5, 0.3, 500.0)], &settings);
    let part = BakedPart { key: 42, metres_per_unit: 0.5, seed: 0 };
    let bytes = made.to_bytes(&part);
    let (read, found) = ElasticModel::from_bytes(&bytes).unwrap();
    assert_eq!((found, read.settings()), (part, made.settings()));
    let run = |model| {
        let mut body = ElasticBody::new(model, Frame::IDENTITY);
        body.push(DVec3::new(0.15, 0.1, 0.0), DVec3::new(0.1, 0.2, 0.3));
        for _ in 0..20 {
            body.step(1.0 / 60.0, &Loads::default(), &mut EmptyWorld);
        }
        body.contact_positions()
    };
    assert_eq!(run(made), run(read.into()));
    // A file that lost a byte or has another one is refused.
    assert!(ElasticModel::from_bytes(&bytes[..bytes.len() - 9]).is_err());
    for at in (0..bytes.len()).step_by(bytes.len() / 61) {
        let mut wrong = bytes.clone();
        wrong[at] ^= 0x10;
        // Between sections there are bytes that say nothing.
        if let Ok((read, _)) = ElasticModel::from_bytes(&wrong) {
            assert_eq!(read.to_bytes(&part), bytes, "byte {at}");
        }
    }
}
