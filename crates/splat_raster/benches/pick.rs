//! What picking takes: building the index, a pick with it, and a pick without.
//!
//! ```sh
//! cargo bench -p splat_raster --bench pick -- SCENE.ply CAMERAS.json
//! ```

#![expect(clippy::print_stdout, reason = "this program prints")]

use std::error::Error;
use std::hint::black_box;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use splat_core::glam::Vec2;
use splat_raster::Scene;
use splat_raster::pick::{PickIndex, PickQuery, pick};

fn main() -> Result<(), Box<dyn Error>> {
    let files: Vec<PathBuf> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).map(PathBuf::from).collect();
    let room = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../assets/room");
    let (scene, cameras) = match &files[..] {
        [scene, cameras] => (scene.clone(), cameras.clone()),
        _ => (room.join("scene.spz"), room.join("cameras.json")),
    };
    let cloud = Arc::new(splat_io::read(&scene)?.0);
    let view = splat_io::cameras::read(&cameras)?.views[0].view.resized(1280, 720);
    let begin = Instant::now();
    let index = PickIndex::new(&cloud);
    println!("{} Gaussians, index built in {:.1} ms", cloud.len(), begin.elapsed().as_secs_f64() * 1e3);
    let scene = Scene::of(cloud);
    for (name, indices, count) in [("with the index", vec![Some(&index)], 2000), ("without", vec![], 10)] {
        let mut times: Vec<f64> = (0..count)
            .map(|k| {
                let pixel = Vec2::new((k * 7919 % 1280) as f32, (k * 104_729 % 720) as f32);
                let begin = Instant::now();
                let _ = black_box(pick(&scene, &indices, &view, PickQuery::at(pixel)));
                begin.elapsed().as_secs_f64() * 1e3
            })
            .collect();
        times.sort_unstable_by(f64::total_cmp);
        println!("a pick {name}: median {:.3} ms, worst {:.3} ms", times[count / 2], times[count - 1]);
    }
    Ok(())
}
