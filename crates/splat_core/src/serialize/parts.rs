//! [`Parts`] as their table and runs of labels.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{base64, varint};
use crate::{PartId, Parts};

#[derive(Serialize, Deserialize)]
#[serde(rename = "Parts")]
struct Stored {
    len: u32,
    /// Label and length of each run of equal labels.
    labels: String,
    /// Labels given out so far, those of removed parts included.
    used: u16,
    parts: Vec<StoredPart>,
}

#[derive(Serialize, Deserialize)]
#[serde(rename = "Part")]
struct StoredPart {
    id: PartId,
    name: String,
    color: [u8; 3],
    /// 0: none.
    parent: u16,
    locked: bool,
}

impl Serialize for Parts {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut labels = Vec::new();
        for run in self.labels().chunk_by(|a, b| a == b) {
            varint::put(&mut labels, u64::from(run[0]));
            varint::put(&mut labels, run.len() as u64);
        }
        let part = |(id, part): (PartId, &crate::Part)| StoredPart {
            id,
            name: part.name.clone(),
            color: part.color,
            parent: part.parent().map_or(0, |up| up.0),
            locked: part.locked(),
        };
        // Ids are 32 bits wide, so a length is too.
        let (len, parts) = (self.len() as u32, self.iter().map(part).collect());
        Stored { len, labels: base64::encode(&labels), used: self.used(), parts }.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Parts {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Stored { len, labels, used, parts } = Stored::deserialize(deserializer)?;
        let labels = base64::decode(&labels).and_then(|bytes| from_runs(len as usize, &bytes));
        let labels = labels.ok_or_else(|| D::Error::custom(format!("the labels of {len} Gaussians are damaged")))?;
        let rows =
            parts.into_iter().map(|p| (p.id, p.name, p.color, Some(PartId(p.parent)).filter(|up| up.0 != 0), p.locked));
        Parts::from_table(labels, used, rows).map_err(D::Error::custom)
    }
}

fn from_runs(len: usize, mut bytes: &[u8]) -> Option<Vec<u16>> {
    let mut runs = Vec::new();
    let mut end = 0usize;
    while !bytes.is_empty() {
        let label = u16::try_from(varint::take(&mut bytes)?).ok()?;
        let count = usize::try_from(varint::take(&mut bytes)?).ok()?;
        end = end.checked_add(count)?;
        runs.push((label, count));
    }
    // Checked before anything of this size is made.
    (end == len).then(|| runs.into_iter().flat_map(|(label, count)| std::iter::repeat_n(label, count)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SelectMode, Selection};

    fn some() -> Parts {
        let mut parts = Parts::new(100);
        let gone = parts.add("gone", [1, 2, 3], None).unwrap();
        let chair = parts.add("chair", [9, 8, 7], None).unwrap();
        let seat = parts.add("seat \"soft\"", [4, 5, 6], Some(chair)).unwrap();
        parts.assign(chair, &Selection::from_fn(100, |i| (20..60).contains(&i)), SelectMode::New).unwrap();
        parts.assign(seat, &Selection::from_fn(100, |i| i % 7 == 0), SelectMode::Add).unwrap();
        parts.remove(gone).unwrap();
        parts.lock(seat).unwrap();
        let last = parts.add("gone too", [0; 3], None).unwrap();
        parts.remove(last).unwrap();
        parts
    }

    #[test]
    fn parts_come_back_with_their_table() {
        for parts in [Parts::default(), Parts::new(7), some()] {
            let text = serde_json::to_string(&parts).unwrap();
            assert_eq!(serde_json::from_str::<Parts>(&text).unwrap(), parts, "{text}");
        }
    }

    #[test]
    fn parts_that_break_their_own_rules_are_refused() {
        let part = |id: u16, parent: u16| {
            format!(r#"{{"id":{id},"name":"","color":[0,0,0],"parent":{parent},"locked":false}}"#)
        };
        let read = |len: u32, labels: &str, parts: &[String]| {
            serde_json::from_str::<Parts>(&format!(
                r#"{{"len":{len},"labels":"{labels}","used":3,"parts":[{}]}}"#,
                parts.join(",")
            ))
        };
        // Two Gaussians of part 1.
        assert_eq!(read(2, "AQI", &[part(1, 0)]).unwrap().labels(), [1, 1]);
        assert!(read(3, "AQI", &[part(1, 0)]).is_err(), "too few labels");
        assert!(read(4_000_000_000, "AP////8P", &[part(1, 0)]).is_err(), "too many labels");
        assert!(read(2, "AQI", &[]).is_err(), "a label without a part");
        assert!(read(2, "AQI", &[part(1, 0), part(1, 0)]).is_err(), "an id twice");
        assert!(read(2, "AQI", &[part(1, 0), part(0, 0)]).is_err(), "an id of 0");
        assert!(read(2, "AQI", &[part(1, 0), part(4, 0)]).is_err(), "a label that was never given out");
        assert!(read(2, "AQI", &[part(1, 2)]).is_err(), "an unknown parent");
        assert!(read(2, "AQI", &[part(1, 1)]).is_err(), "its own parent");
        assert!(read(2, "AQI", &[part(1, 2), part(2, 3), part(3, 0)]).is_err(), "nested twice");
    }
}
