//! Samples without a header, which somebody describes in a word.

use super::layout::{Coding, Data, Layout, Skip};
use super::samples::{ByteOrder, SampleKind};
use crate::error::{Error, Result};
use crate::volume::Placement;
use std::str::FromStr;

/// What a file of nothing but samples holds; written as `256x256x128:u16le`, with `:skip=BYTES` behind where something else stands before them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RawLayout {
    /// Number of samples along x, y and z, x fastest.
    pub size: [u64; 3],
    /// Their type.
    pub kind: SampleKind,
    /// The order of their bytes.
    pub order: ByteOrder,
    /// Bytes before them.
    pub skip: u64,
}

impl FromStr for RawLayout {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        parse(text).ok_or_else(|| {
            let problem = format!("\"{text}\" does not describe samples");
            let remedy = "say size and type as in 256x256x128:u16le, 64x64x64:u8 or 64x64x64:f32be:skip=512";
            Error::setting("raw", problem, remedy)
        })
    }
}

fn parse(text: &str) -> Option<RawLayout> {
    let mut parts = text.split(':');
    let size: Option<Vec<u64>> = parts.next()?.split(['x', 'X']).map(|n| n.parse().ok().filter(|&n| n > 0)).collect();
    let name = parts.next()?.to_ascii_lowercase();
    let (name, order) = match (name.strip_suffix("le"), name.strip_suffix("be")) {
        (Some(name), _) => (name, ByteOrder::Little),
        (_, Some(name)) => (name, ByteOrder::Big),
        _ => (name.as_str(), ByteOrder::Little),
    };
    let kind = SampleKind::from_name(name)?;
    let skip = parts.next().map_or(Some(0), |skip| skip.strip_prefix("skip=")?.parse().ok())?;
    parts.next().is_none().then_some(())?;
    Some(RawLayout { size: size?.try_into().ok()?, kind, order, skip })
}

impl RawLayout {
    pub(super) fn layout(&self) -> Layout {
        Layout {
            size: self.size,
            placement: Placement::default(),
            kind: self.kind,
            order: self.order,
            channels: 1,
            coding: Coding::Raw,
            data: Data::Here(self.skip),
            skip: Skip::NOTHING,
            scale: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn descriptions_are_understood() {
        let layout: RawLayout = "256x128x64:U16be".parse().unwrap();
        assert_eq!((layout.size, layout.kind, layout.order), ([256, 128, 64], SampleKind::U16, ByteOrder::Big));
        let layout: RawLayout = "1x2x3:f64:skip=352".parse().unwrap();
        assert_eq!((layout.kind, layout.order, layout.skip), (SampleKind::F64, ByteOrder::Little, 352));
        for bad in ["", "1x2x3", "1x2:u8", "0x2x3:u8", "1x2x3:u7", "1x2x3:u8:9", "1x2x3:u8:skip=1:x", "1x2x3x4:u8"] {
            assert!(bad.parse::<RawLayout>().unwrap_err().to_string().starts_with("raw: "), "{bad}");
        }
    }
}
