//! The machine, in words.

use std::fs::read_to_string;

/// Processor, cores that this program may use, memory, system.
pub(crate) fn describe() -> String {
    let line = |path: &str, name: &str| {
        let text = read_to_string(path).unwrap_or_default();
        let value = text.lines().find(|l| l.starts_with(name)).and_then(|l| l.split_once(':')).map(|(_, v)| v.trim());
        value.unwrap_or("unknown").to_owned()
    };
    let cores = std::thread::available_parallelism().map_or(0, usize::from);
    let memory = line("/proc/meminfo", "MemTotal");
    let memory = memory
        .trim_end_matches(" kB")
        .parse::<f64>()
        .map_or(memory.clone(), |kib| format!("{:.0} GiB", kib / 1024.0 / 1024.0));
    let system = read_to_string("/etc/os-release").unwrap_or_default();
    let system = system.lines().find_map(|l| l.strip_prefix("PRETTY_NAME=")).unwrap_or(std::env::consts::OS);
    format!(
        "Machine: {}, {cores} threads, {memory}, {}\n",
        line("/proc/cpuinfo", "model name"),
        system.trim_matches('"')
    )
}
