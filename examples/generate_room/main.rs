//! Makes the generated room of `assets/room`: a seeded, indoor "capture" with labels, cameras, held-back views, masks and prompts.
//!
//! ```text
//! cargo run --release --example generate_room [FOLDER]
//! ```
//!
//! Solids given as distance functions ([`shapes`], [`room`]) are covered with Gaussians ([`sample`], [`gaussians`]), lit
//! ([`light`]), written as SPZ, and read back: the decoded file is the scene from which labels, weights, label maps and prompts are
//! made ([`bench`], [`prompts`]). The same seed gives the same room on every machine.

mod bench;
mod cameras;
mod capture;
mod field;
mod furniture;
mod gaussians;
mod light;
mod materials;
mod math;
mod prompts;
mod room;
mod sample;
mod shapes;
mod things;

use std::path::{Path, PathBuf};

use bench::{Bench, Failure};
use splat_core::Cloud;
use splat_io::WriteOptions;

/// Seed of the committed room.
const SEED: u64 = 1;
/// Name of the scene's file.
const SCENE: &str = "scene.spz";

fn main() -> Result<(), Failure> {
    let folder = std::env::args_os().nth(1).map_or_else(committed, PathBuf::from);
    std::fs::create_dir_all(&folder)?;
    let (bytes, labels) = packed(SEED)?;
    std::fs::write(folder.join(SCENE), &bytes)?;
    let (cloud, _) = splat_io::read_bytes(&bytes, SCENE)?;
    let views = |list: Vec<cameras::Camera>| list.iter().map(cameras::Camera::view).collect::<Vec<_>>();
    let bench = Bench::new(cloud, labels, views(cameras::training()), views(cameras::held_back()))?;
    bench.write(&folder)
}

/// Where the committed room lies.
fn committed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/room")
}

/// The room as bytes of its file, and the label of every Gaussian in that file.
fn packed(seed: u64) -> Result<(Vec<u8>, Vec<u8>), Failure> {
    let (cloud, labels) = room_cloud(seed)?;
    let format = splat_io::format_named("spz").ok_or("no writer for SPZ in this build")?;
    let mut bytes = Vec::new();
    let written = splat_io::write_as(format, &cloud, &WriteOptions::default(), &mut bytes)?;
    let labels = match written.order {
        Some(order) => order.into_iter().map(|k| labels[k as usize]).collect(),
        None => labels,
    };
    Ok((bytes, labels))
}

/// The room before it is packed.
fn room_cloud(seed: u64) -> Result<(Cloud, Vec<u8>), Failure> {
    Ok(capture::cloud(&gaussians::dabs(&room::solids(), seed))?)
}

#[cfg(test)]
mod tests {
    use serde_json::Value;
    use splat_io::{npy, picture};

    use super::*;
    use crate::prompts::deepest;

    fn json(name: &str) -> Value {
        serde_json::from_slice(&std::fs::read(committed().join(name)).unwrap()).unwrap()
    }

    #[test]
    fn the_seed_gives_the_committed_scene() {
        let (bytes, labels) = packed(SEED).unwrap();
        let (made, _) = splat_io::read_bytes(&bytes, SCENE).unwrap();
        let (kept, _) = splat_io::read(committed().join(SCENE)).unwrap();
        assert_eq!(made.len(), kept.len());
        assert_eq!(made.content_hash(), kept.content_hash());
        assert_eq!(labels, npy::read_u8(committed().join("labels.npy")).unwrap());
    }

    #[test]
    fn labels_and_weights_fit_the_statistics() {
        let labels = npy::read_u8(committed().join("labels.npy")).unwrap();
        let weight = npy::read_f32(committed().join("weight.npy")).unwrap();
        let stats = json("stats.json");
        assert_eq!(labels.len(), weight.len());
        assert_eq!(stats["gaussians"], labels.len());
        for object in stats["objects"].as_array().unwrap() {
            let label = object["label"].as_u64().unwrap() as u8;
            let ids: Vec<usize> = (0..labels.len()).filter(|&i| labels[i] == label).collect();
            assert_eq!(object["name"], room::NAMES[usize::from(label) - 1]);
            assert_eq!(object["gaussians"], ids.len(), "{object}");
            assert_eq!(object["visible"], ids.iter().filter(|&&i| weight[i] > 1.0).count(), "{object}");
        }
    }

    #[test]
    fn every_click_lies_deep_in_its_mask_and_areas_and_boxes_fit() {
        let folder = committed();
        let cameras = splat_io::cameras::read(folder.join("cameras.json")).unwrap();
        let mut cut = 0;
        for prompt in json("prompts.json").as_array().unwrap() {
            cut += usize::from(prompt["kind"] == "cut");
            let views = std::iter::once(prompt).chain(prompt["corrections"].as_array().unwrap());
            for view in views {
                let mask = picture::read_mask(folder.join(view["mask"].as_str().unwrap())).unwrap();
                let camera = &cameras.views[view["camera"].as_u64().unwrap() as usize].view;
                assert_eq!((mask.width(), mask.height()), (camera.width, camera.height));
                assert_eq!(view["area"], mask.count(), "{view}");
                let click: Vec<u32> =
                    view["click"].as_array().unwrap().iter().map(|x| x.as_u64().unwrap() as u32).collect();
                assert!(mask.contains(click[0], click[1]), "{view}");
                assert_eq!(deepest(&mask).0, click[..], "{view}");
                if let Some(b) = view["box"].as_array() {
                    let b: Vec<u32> = b.iter().map(|x| x.as_u64().unwrap() as u32).collect();
                    let outside = (0..mask.height())
                        .flat_map(|y| (0..mask.width()).map(move |x| (x, y)))
                        .filter(|&(x, y)| mask.contains(x, y))
                        .filter(|&(x, y)| x < b[0] || y < b[1] || x > b[2] || y > b[3])
                        .count();
                    assert_eq!(outside, 0, "{view}");
                }
            }
        }
        assert!(cut >= 5, "{cut} prompts with objects that the edge cuts off");
    }

    #[test]
    fn the_deepest_pixel_of_a_block_is_its_middle_and_of_a_block_at_the_edge_too() {
        let block =
            |x0: u32| splat_core::Mask2d::from_fn(40, 30, |x, y| (x0..x0 + 9).contains(&x) && (8..17).contains(&y));
        assert_eq!(deepest(&block(10)), ([14, 12], 5.0));
        assert_eq!(deepest(&block(0)), ([4, 12], 5.0));
        assert_eq!(deepest(&splat_core::Mask2d::empty(4, 4)).1, 0.0);
    }
}
