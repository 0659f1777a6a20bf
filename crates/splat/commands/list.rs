//! `splat list`: everything this build can do, from the tables where it is registered.

use clap::{Args, FromArgMatches};
use serde::Serialize;
use splat_io::FORMATS;
use splat_io::cameras::CAMERA_FORMATS;
use splat_segment::aggregations::AGGREGATIONS;
use splat_segment::trackers::TRACKERS;

use super::{COMMANDS, Command};
use crate::failure::Failure;
use crate::terminal::Terminal;

pub(crate) const COMMAND: Command = Command {
    name: "list",
    about: "List the formats, commands, trackers and aggregations of this build",
    examples: "  splat list\n  splat list formats --json\n  splat list --markdown > FEATURES.md",
    options: Options::augment_args,
    run: |matches, terminal| run(&Options::from_arg_matches(matches)?, terminal),
};

#[derive(Args, Debug)]
struct Options {
    /// Only this table
    #[arg(value_parser = ["formats", "cameras", "commands", "trackers", "aggregations"])]
    table: Option<String>,
    /// As Markdown tables, for documents
    #[arg(long)]
    markdown: bool,
}

/// A table to print: a title, names of columns, rows.
#[derive(Serialize)]
struct Table {
    name: &'static str,
    columns: &'static [&'static str],
    rows: Vec<Vec<String>>,
}

fn run(options: &Options, terminal: &Terminal) -> Result<(), Failure> {
    let wanted = |t: &Table| options.table.as_deref().is_none_or(|name| name == t.name);
    let tables: Vec<Table> = tables().into_iter().filter(wanted).collect();
    let form = if options.markdown { Table::markdown } else { Table::text };
    terminal.report(&tables, || tables.iter().map(form).collect::<Vec<_>>().join("\n"))
}

fn tables() -> Vec<Table> {
    let yes = |b: bool| if b { "yes" } else { "no" }.to_owned();
    let dotted = |e: &[&str]| e.iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(" ");
    let row = |cells: &[&str]| cells.iter().map(|&c| c.to_owned()).collect::<Vec<_>>();
    vec![
        Table {
            name: "formats",
            columns: &["format", "endings", "write", "lossless", "what it is"],
            rows: FORMATS
                .iter()
                .map(|f| {
                    let name = f.name().to_owned();
                    vec![name, dotted(f.extensions()), yes(f.writable()), yes(!f.lossy()), f.description().to_owned()]
                })
                .collect(),
        },
        Table {
            name: "cameras",
            columns: &["format", "files", "what it is"],
            rows: CAMERA_FORMATS.iter().map(|f| row(&[f.name(), &f.file_names().join(" "), f.description()])).collect(),
        },
        Table {
            name: "commands",
            columns: &["command", "what it does"],
            rows: COMMANDS.iter().map(|c| row(&[c.name, c.about])).collect(),
        },
        Table {
            name: "trackers",
            columns: &["tracker", "what it does"],
            rows: TRACKERS.iter().map(|t| row(&[t.name(), t.description()])).collect(),
        },
        Table {
            name: "aggregations",
            columns: &["aggregation", "what it does", "source"],
            rows: AGGREGATIONS.iter().map(|a| row(&[a.name(), a.description(), a.source()])).collect(),
        },
    ]
}

impl Table {
    fn text(&self) -> String {
        let columns = self.columns.len();
        let rows =
            std::iter::once(self.columns.iter().map(|&c| c.to_owned()).collect()).chain(self.rows.iter().cloned());
        let rows: Vec<Vec<String>> = rows.collect();
        let width = |k: usize| rows.iter().map(|r| r[k].chars().count()).max().unwrap_or(0);
        // The last column is not padded.
        let widths: Vec<usize> = (0..columns).map(|k| if k + 1 < columns { width(k) + 2 } else { 0 }).collect();
        let line = |row: &Vec<String>| {
            let cells: String = row.iter().zip(&widths).map(|(cell, &w)| format!("{cell:<w$}")).collect();
            format!("  {}\n", cells.trim_end())
        };
        format!("{}\n{}", self.name, rows.iter().map(line).collect::<String>())
    }

    fn markdown(&self) -> String {
        let line = |cells: &[String]| {
            // A bar inside a cell would end it.
            let cells: Vec<String> = cells.iter().map(|c| c.replace('|', "\\|")).collect();
            format!("| {} |\n", cells.join(" | "))
        };
        let head: Vec<String> = self.columns.iter().map(|&c| c.to_owned()).collect();
        let rule: Vec<String> = self.columns.iter().map(|_| "---".to_owned()).collect();
        [line(&head), line(&rule)].into_iter().chain(self.rows.iter().map(|r| line(r))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bar_in_a_cell_does_not_break_the_table() {
        let table = Table { name: "t", columns: &["a", "b"], rows: vec![vec!["x|y".to_owned(), "z".to_owned()]] };
        assert_eq!(table.markdown(), "| a | b |\n| --- | --- |\n| x\\|y | z |\n");
        assert_eq!(table.text(), "t\n  a    b\n  x|y  z\n");
    }
}
