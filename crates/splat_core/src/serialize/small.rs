//! What serde's derives would do, for types whose definitions do not know serde.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::{GaussianId, PartId, SelectMode};

impl Serialize for PartId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for PartId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        u16::deserialize(deserializer).map(Self)
    }
}

impl Serialize for GaussianId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for GaussianId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        u32::deserialize(deserializer).map(Self)
    }
}

#[derive(Serialize, Deserialize)]
#[serde(remote = "SelectMode", rename = "SelectMode")]
enum Mode {
    New,
    Add,
    Subtract,
    Intersect,
}

impl Serialize for SelectMode {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Mode::serialize(self, serializer)
    }
}

impl<'de> Deserialize<'de> for SelectMode {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Mode::deserialize(deserializer)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_are_numbers_and_modes_are_names() {
        assert_eq!(
            serde_json::to_string(&(PartId(7), GaussianId(8), SelectMode::Subtract)).unwrap(),
            r#"[7,8,"Subtract"]"#
        );
        let back: (PartId, GaussianId, SelectMode) = serde_json::from_str(r#"[7,8,"Add"]"#).unwrap();
        assert_eq!(back, (PartId(7), GaussianId(8), SelectMode::Add));
        assert!(serde_json::from_str::<PartId>("65536").is_err());
    }
}
