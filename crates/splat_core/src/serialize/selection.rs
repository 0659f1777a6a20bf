//! A [`Selection`] as its length and either runs or words, whichever is shorter.

use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{base64, varint};
use crate::{Selection, SelectionDelta};

#[derive(Serialize, Deserialize)]
#[serde(rename = "Selection")]
struct Stored {
    len: u32,
    bits: Bits,
}

#[derive(Serialize, Deserialize)]
enum Bits {
    /// For each run of selected Gaussians: how many before it are not, and how many it has.
    Runs(String),
    /// 64 Gaussians a word, lowest bit first, little endian.
    Words(String),
}

impl Serialize for Selection {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut runs = Vec::new();
        let mut end = 0;
        for &(start, count) in SelectionDelta::between(&Selection::none(self.len()), self).runs() {
            varint::put(&mut runs, u64::from(start - end));
            varint::put(&mut runs, u64::from(count));
            end = start + count;
        }
        let bits = if runs.len() <= self.words().len() * 8 {
            Bits::Runs(base64::encode(&runs))
        } else {
            let words: Vec<u8> = self.words().iter().flat_map(|word| word.to_le_bytes()).collect();
            Bits::Words(base64::encode(&words))
        };
        // Ids are 32 bits wide, so a length is too.
        Stored { len: self.len() as u32, bits }.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for Selection {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let Stored { len, bits } = Stored::deserialize(deserializer)?;
        let read = match bits {
            Bits::Runs(text) => base64::decode(&text).and_then(|bytes| from_runs(len as usize, &bytes)),
            Bits::Words(text) => base64::decode(&text).and_then(|bytes| from_words(len as usize, &bytes)),
        };
        read.ok_or_else(|| D::Error::custom(format!("the bits of a selection of {len} Gaussians are damaged")))
    }
}

fn from_runs(len: usize, mut bytes: &[u8]) -> Option<Selection> {
    let mut runs = Vec::new();
    let mut end = 0usize;
    while !bytes.is_empty() {
        let start = end.checked_add(usize::try_from(varint::take(&mut bytes)?).ok()?)?;
        end = start.checked_add(usize::try_from(varint::take(&mut bytes)?).ok()?)?;
        runs.push(start..end);
    }
    if end > len {
        return None;
    }
    let mut selection = Selection::none(len);
    runs.into_iter().for_each(|run| selection.toggle(run));
    Some(selection)
}

fn from_words(len: usize, bytes: &[u8]) -> Option<Selection> {
    let (words, rest) = bytes.as_chunks::<8>();
    let words: Vec<u64> = words.iter().map(|word| u64::from_le_bytes(*word)).collect();
    if !rest.is_empty() || words.len() != len.div_ceil(64) {
        return None;
    }
    let given = words.clone();
    let selection = Selection::from_words(len, words);
    (selection.words() == given).then_some(selection)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn there_and_back(selection: &Selection) -> usize {
        let text = serde_json::to_string(selection).unwrap();
        assert_eq!(&serde_json::from_str::<Selection>(&text).unwrap(), selection);
        text.len()
    }

    #[test]
    fn selections_come_back_and_runs_are_short() {
        assert!(there_and_back(&Selection::default()) < 40);
        for len in [1, 63, 64, 65, 1000] {
            there_and_back(&Selection::none(len));
            there_and_back(&Selection::all(len));
            there_and_back(&Selection::from_fn(len, |i| i % 3 == 0));
        }
        let object = Selection::from_fn(1_000_000, |i| (40_000..90_000).contains(&i));
        assert!(there_and_back(&object) < 60);
        // Noise costs its bits and a third, not more.
        let noise = Selection::from_fn(100_000, |i| (i as u64).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 63 == 1);
        assert!(there_and_back(&noise) < 100_000 / 6 + 100);
    }

    #[test]
    fn damaged_selections_are_refused() {
        for text in [
            r#"{"len":4,"bits":{"Runs":"AAU"}}"#,
            r#"{"len":4,"bits":{"Runs":"AA"}}"#,
            r#"{"len":4,"bits":{"Runs":"!"}}"#,
            r#"{"len":4,"bits":{"Runs":"AP///////////wE"}}"#,
            r#"{"len":4,"bits":{"Words":"AAAA"}}"#,
            r#"{"len":4,"bits":{"Words":"/wAAAAAAAAA"}}"#,
            r#"{"len":-1,"bits":{"Runs":""}}"#,
        ] {
            let error = serde_json::from_str::<Selection>(text).unwrap_err().to_string();
            assert!(error.contains("4 Gaussians") || error.contains("-1"), "{text}: {error}");
        }
        assert!(serde_json::from_str::<Selection>(r#"{"len":5,"bits":{"Runs":"AAU"}}"#).is_ok());
    }
}
