//! `--device`: how frames grow with the cloud, and what memory bandwidth allows.

use peer_common::Failure;

use crate::contenders::{CONTENDERS, Job, Runner};
use crate::table::Row;
use crate::{Options, scene};

/// Pixels across and down.
const SIZE: (u32, u32) = (1920, 1080);

/// Tables for all counts, each told when it is known.
pub(crate) fn run(
    options: &Options,
    runner: &Runner,
    say: &mut impl FnMut(String) -> Result<(), Failure>,
) -> Result<(), Failure> {
    let bandwidth = runner.ask(&["bandwidth"]);
    // Bytes per millisecond.
    let rate = bandwidth.as_ref().ok().and_then(|r| r.stages.first()).and_then(|s| Some(s.bytes? / s.ms));
    say(match (&bandwidth, rate) {
        (Ok(report), Some(rate)) => {
            format!("Device: {}; copies {:.0} GB/s, read and written\n", report.device, rate * 1e-6)
        }
        (Err(failure), _) => format!("Memory bandwidth: {failure}\n"),
        _ => String::new(),
    })?;
    for &count in &options.counts {
        let path = runner.out.join(format!("generated-{count}.ply"));
        let cloud = scene::generated(count)?;
        scene::write(&cloud, &path)?;
        let cameras = runner.out.join("cameras.json");
        scene::cameras(&cloud, None, SIZE)?.write(&cameras)?;
        drop(cloud);
        let job =
            Job { scene: &path, cameras: &cameras, size: SIZE, warmup: options.warmup.max(10), frames: options.frames };
        let wanted = |name: &str| options.only.is_empty() || options.only.iter().any(|word| name.contains(&**word));
        let mut rows: Vec<Row> = CONTENDERS.iter().filter(|c| c.sweeps && wanted(c.name)).map(Row::new).collect();
        for round in 0..options.rounds {
            for row in &mut rows {
                eprintln!("{count} Gaussians: round {} of {}, {}", round + 1, options.rounds, row.contender.name);
                row.add(runner.measure(row.contender, &job));
            }
        }
        for row in &mut rows {
            row.staged = runner.stages(row.contender, &job).ok();
        }
        say(section(count, &rows, rate))?;
        // The large ones take gigabytes.
        let _ = std::fs::remove_file(&path);
    }
    Ok(())
}

fn section(count: usize, rows: &[Row], rate: Option<f64>) -> String {
    let mut text = format!("\n## {count} Gaussians, {}x{}\n\n", SIZE.0, SIZE.1);
    text += "| contender | wall ms (least) | frames/s | wall : ours | stages, ms on the device (least that memory allows) |\n";
    text += "|---|---|---|---|---|\n";
    let ours = rows.first().and_then(Row::wall);
    for row in rows {
        let Some((wall, least)) = row.wall() else {
            let why = row.failures.first().map(ToString::to_string).unwrap_or_default();
            text += &format!("| {} | - | - | - | {why} |\n", row.contender.name);
            continue;
        };
        let stages: Vec<String> = row
            .stages()
            .filter(|(name, ms, _)| *ms >= 5e-3 && !name.ends_with(" cpu"))
            .map(|(name, ms, bytes)| match bytes.zip(rate) {
                Some((bytes, rate)) => format!("{name} {ms:.2} ({:.2})", bytes / rate),
                None => format!("{name} {ms:.2}"),
            })
            .collect();
        text += &format!(
            "| {} | {wall:.2} ({least:.2}) | {:.0} | {} | {} |\n",
            row.contender.name,
            1e3 / wall,
            ours.map_or("-".to_owned(), |(own, _)| format!("{:.2}", wall / own)),
            stages.join(", ")
        );
    }
    text
}
