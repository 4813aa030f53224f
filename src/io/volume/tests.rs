//! All formats, in all their ways, against the same small volume; and what is wrong with files.

use super::*;
use crate::progress::Silent;
use crate::volume::{Placement, Volume, Voxels};
use glam::{DMat3, DVec3};

/// 3 x 2 x 2 samples.
const SIZE: [usize; 3] = [3, 2, 2];

fn numbers() -> Vec<i16> {
    (0..12).map(|i| 100 * i - 300).collect()
}

fn placement() -> Placement {
    let axes = DMat3::from_cols(DVec3::new(0.0, 2.0, 0.0), DVec3::new(-0.5, 0.0, 0.0), DVec3::new(0.0, 0.0, 4.0));
    Placement { origin: DVec3::new(1.0, -2.0, 0.1), axes }
}

fn image() -> Image {
    Image::new(SIZE, placement(), Voxels::I16(numbers())).unwrap()
}

fn data(big: bool) -> Vec<u8> {
    numbers().into_iter().flat_map(|n| if big { n.to_be_bytes() } else { n.to_le_bytes() }).collect()
}

fn read(bytes: &[u8]) -> Result<VolumeFile> {
    read_volume_bytes("t", bytes, &VolumeOptions::default(), &Silent)
}

fn message(bytes: &[u8]) -> String {
    read(bytes).map(|file| file.info).expect_err("malformed").to_string()
}

const META: &str = "ObjectType = Image\nNDims = 3\nDimSize = 3 2 2\nElementSpacing = 2 .5 4\nOffset = 1 -2 0.1\n\
                    TransformMatrix = 0 1 0 -1 0 0 0 0 1\nElementType = MET_SHORT\n";
const NRRD: &str = "NRRD0005\n# a comment\ntype: short\ndimension: 3\nsizes: 3 2 2\nkey:=value\nspace: left-posterior-superior\n\
                    space directions: (0,2,0) (-.5,0,0) (0,0,4)\nspace origin: (1,-2,.1)\n";

#[test]
fn metaimages_are_read() {
    let with = |lines: &str, data: &[u8]| [META.as_bytes(), lines.as_bytes(), data].concat();
    let text = numbers().iter().map(i16::to_string).collect::<Vec<_>>().join(" ");
    for bytes in [
        with("ElementDataFile = LOCAL\n", &data(false)),
        with("ElementByteOrderMSB = True\r\nElementDataFile = LOCAL\r\n", &data(true)),
        with("HeaderSize = 5\nElementDataFile = LOCAL\n", &[b"12345", &data(false)[..]].concat()),
        with("HeaderSize = -1\nElementDataFile = LOCAL\n", &[b"whatever", &data(false)[..]].concat()),
        with("BinaryData = False\nElementDataFile = LOCAL\n", text.as_bytes()),
    ] {
        let file = read(&bytes).unwrap();
        assert_eq!((&file.image, file.info.trailing_bytes), (&image(), 0));
    }
    let file = read(&with("ElementDataFile = LOCAL\n", &[&data(false)[..], b"more"].concat())).unwrap();
    assert_eq!((file.info.format, file.info.trailing_bytes), (VolumeFormat::MetaImage, 4));
}

#[test]
fn nrrd_files_are_read() {
    let with = |lines: &str, data: &[u8]| [NRRD.as_bytes(), lines.as_bytes(), b"\n", data].concat();
    let text = numbers().iter().map(i16::to_string).collect::<Vec<_>>().join("\n");
    let hex = data(true).iter().map(|b| format!("{b:02x}")).collect::<Vec<_>>().join(" ");
    for bytes in [
        with("endian: little\nencoding: raw\n", &data(false)),
        with("endian: big\r\nencoding: raw\r\n", &data(true)),
        with("encoding: ascii\n", text.as_bytes()),
        with("endian: big\nencoding: hex\n", hex.as_bytes()),
        with("endian: big\nencoding: raw\nline skip: 2\nbyte skip: 1\n", &[b"a\nb\nc", &data(true)[..]].concat()),
        with("endian: big\nencoding: raw\nbyte skip: -1\n", &[b"a\nb\nc", &data(true)[..]].concat()),
    ] {
        assert_eq!(read(&bytes).unwrap().image, image());
    }
    // Places can be told by ranges of the axes; colours and vectors are channels.
    let plain = b"NRRD0001\ntype: uchar\ndimension: 4\nsizes: 2 3 1 2\nkinds: vector domain domain domain\nencoding: raw\n\
                  axis mins: nan 1 2 3\naxis maxs: nan 7 4 5\ncenters: none cell cell node\n\n\0\x01\x02\x03\x04\x05\x06\x07\x08\x09\x0a\x0b";
    assert!(message(plain).contains("each sample has 2 numbers; say which one is meant: --channel 0"));
    let options = VolumeOptions { channel: Some(1), ..VolumeOptions::default() };
    let file = read_volume_bytes("t", plain, &options, &Silent).unwrap();
    assert_eq!((file.image.size(), file.image.voxels()), ([3, 1, 2], &Voxels::U8(vec![1, 3, 5, 7, 9, 11])));
    let expected = Placement::with_spacing(DVec3::new(2.0, 3.0, 3.0), DVec3::splat(2.0));
    assert_eq!(file.image.placement(), expected);
}

#[test]
fn nifti_files_are_read() {
    let rows = [[0.0f32, -0.5, 0.0, 1.0], [2.0, 0.0, 0.0, -2.0], [0.0, 0.0, 4.0, 0.1]];
    let header = |big: bool| {
        let mut bytes = vec![0; 352];
        let mut put = |at: usize, number: &[u8]| {
            let mut number = number.to_vec();
            if big {
                number.reverse();
            }
            bytes[at..at + number.len()].copy_from_slice(&number);
        };
        put(0, &348i32.to_le_bytes());
        [3i16, 3, 2, 2, 1].iter().zip(0..).for_each(|(n, i)| put(40 + 2 * i, &n.to_le_bytes()));
        put(70, &4i16.to_le_bytes());
        [1.0f32, 2.0, 0.5, 4.0].iter().zip(0..).for_each(|(n, i)| put(76 + 4 * i, &n.to_le_bytes()));
        put(108, &352.0f32.to_le_bytes());
        put(344, if big { b"\x001+n" } else { b"n+1\0" });
        bytes
    };
    for big in [false, true] {
        let number = |n: f32| if big { n.to_be_bytes() } else { n.to_le_bytes() };
        let code = |n: i16| if big { n.to_be_bytes() } else { n.to_le_bytes() };
        let mut bytes = header(big);
        bytes.extend(data(big));
        // Method 1: nothing but distances.
        let plain = read(&bytes).unwrap().image;
        assert_eq!(plain.placement(), Placement::with_spacing(DVec3::ZERO, DVec3::new(2.0, 0.5, 4.0)));
        assert_eq!(plain.voxels(), image().voxels());
        // Method 2: a quarter of a turn round z.
        bytes[252..254].copy_from_slice(&code(1));
        bytes[264..268].copy_from_slice(&number(0.5f32.sqrt()));
        [1.0, -2.0, 0.1].into_iter().zip(0..).for_each(|(n, i)| bytes[268 + 4 * i..][..4].copy_from_slice(&number(n)));
        let turned = read(&bytes).unwrap().image.placement();
        assert!((turned.axes - placement().axes).to_cols_array().iter().all(|d| d.abs() < 1e-6), "{turned:?}");
        // Method 3: rows of a matrix. And values by a slope.
        bytes[254..256].copy_from_slice(&code(1));
        for (r, c) in (0..12).map(|i| (i / 4, i % 4)) {
            bytes[280 + 16 * r + 4 * c..][..4].copy_from_slice(&number(rows[r][c]));
        }
        bytes[112..116].copy_from_slice(&number(0.5));
        bytes[116..120].copy_from_slice(&number(10.0));
        let file = read(&bytes).unwrap();
        assert_eq!(file.image.placement().axes, placement().axes);
        assert_eq!((file.image.value([0, 0, 0]), file.image.value([2, 1, 1])), (-140.0, 410.0));
        bytes[70..72].copy_from_slice(&code(128));
        assert!(message(&bytes).contains("datatype 128"));
        bytes[40..42].copy_from_slice(&code(4));
        bytes[48..50].copy_from_slice(&code(7));
        assert!(message(&bytes).contains("several volumes"));
    }
}

#[test]
fn older_vtk_files_are_read() {
    let head = "# vtk DataFile Version 3.0\na title\nBINARY\nDATASET STRUCTURED_POINTS\nDIMENSIONS 3 2 2\nSPACING 2 .5 4\n\
                ORIGIN 1 -2 .1\nPOINT_DATA 12\nSCALARS values short 1\nLOOKUP_TABLE default\n";
    let file = read(&[head.as_bytes(), &data(true)].concat()).unwrap();
    assert_eq!(file.image.voxels(), image().voxels());
    assert_eq!(file.image.placement(), Placement::with_spacing(placement().origin, DVec3::new(2.0, 0.5, 4.0)));
    let text = numbers().iter().map(i16::to_string).collect::<Vec<_>>().join(" ");
    let ascii = head.replace("BINARY", "ASCII").replace("POINT_DATA", "CELL_DATA").replace("3 2 2", "4 3 3") + &text;
    let file = read(ascii.as_bytes()).unwrap();
    assert_eq!(file.image.voxels(), image().voxels());
    assert_eq!(file.image.placement().origin, placement().origin + DVec3::new(1.0, 0.25, 2.0));
    assert!(
        message(head.replace("STRUCTURED_POINTS", "POLYDATA").as_bytes()).contains("line 4: only structured points")
    );
}

#[test]
fn raw_samples_are_read_as_described() {
    let options = VolumeOptions { raw: Some("3x2x2:i16be:skip=2".parse().unwrap()), ..VolumeOptions::default() };
    let file = read_volume_bytes("t", &[&[1, 2], &data(true)[..]].concat(), &options, &Silent).unwrap();
    assert_eq!((file.info.format, file.image.voxels()), (VolumeFormat::Raw, image().voxels()));
    // Also far behind what is read at once.
    let options = VolumeOptions { raw: Some("3x2x2:i16le:skip=3000000".parse().unwrap()), ..VolumeOptions::default() };
    let far = [&vec![7; 3_000_000][..], &data(false)].concat();
    assert_eq!(read_volume_bytes("t", &far, &options, &Silent).unwrap().image.voxels(), image().voxels());
}

#[test]
fn what_is_written_is_read_again() {
    let directory = tempfile::tempdir().unwrap();
    for voxels in [
        Voxels::U8((0..12).collect()),
        Voxels::I8((-6..6).collect()),
        Voxels::U16((0..12).map(|n| n * 5000).collect()),
        Voxels::I16(numbers()),
        Voxels::U32((0..12).map(|n| n * 300_000_000).collect()),
        Voxels::I32((0..12).map(|n| n * -100_000_000).collect()),
        Voxels::F32((0..12).map(|n| n as f32 * 0.1).collect()),
        Voxels::F64((0..12).map(|n| f64::from(n) * 0.1).collect()),
    ] {
        let image = Image::new(SIZE, placement(), voxels).unwrap();
        for name in ["a.mha", "a.NRRD"] {
            let path = directory.path().join(name);
            let bytes = write_volume(&path, &image, &Silent).unwrap();
            assert_eq!(bytes, std::fs::metadata(&path).unwrap().len());
            let file = read_volume(&path, &VolumeOptions::default(), &Silent).unwrap();
            assert_eq!(file.image, image);
            assert_eq!(VolumeFormat::of_file(&path).unwrap(), VolumeFormat::from_path(&path));
        }
    }
    for name in ["a.mhd", "a.nhdr", "a.vti", "a"] {
        let message = write_volume(directory.path().join(name), &image(), &Silent).unwrap_err().to_string();
        assert!(message.ends_with("give it a name that ends in .mha or .nrrd"), "{message}");
    }
}

#[test]
fn data_in_other_files_are_found() {
    let directory = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(directory.path().join(name), bytes).unwrap();
    let read = |name: &str| read_volume(directory.path().join(name), &VolumeOptions::default(), &Silent);
    let bytes = data(false);
    write("all.raw", &bytes);
    write("s08", &[b"head", &bytes[..12]].concat());
    write("s09", &[b"head", &bytes[12..]].concat());
    let nrrd = format!("{NRRD}endian: little\nencoding: raw\n");
    for (name, header) in [
        ("a.mhd", format!("{META}ElementDataFile = all.raw")),
        ("b.mhd", format!("{META}HeaderSize = 4\nElementDataFile = LIST\ns08\ns09\n")),
        ("c.mhd", format!("{META}HeaderSize = -1\nElementDataFile = s%02d 8 9 1\n")),
        ("a.nhdr", format!("{nrrd}data file: all.raw\n")),
        ("b.nhdr", format!("{nrrd}byte skip: -1\ndata file: LIST\ns08\ns09\n")),
        ("c.nhdr", format!("{nrrd}byte skip: 4\ndata file: s%02d 8 9 1\n")),
    ] {
        write(name, header.as_bytes());
        assert_eq!(read(name).unwrap().image, image(), "{name}");
    }
    write("d.mhd", format!("{META}ElementDataFile = none.raw").as_bytes());
    assert!(read("d.mhd").unwrap_err().to_string().contains("put that file there"));
    write("e.mhd", format!("{META}ElementDataFile = .").as_bytes());
    assert!(read("e.mhd").unwrap_err().to_string().contains("is no file"));
    write("all.raw", &bytes[..20]);
    let message = read("a.mhd").unwrap_err().to_string();
    assert!(message.contains("all.raw: 3 x 2 x 2 samples of the type i16 take 24 bytes, and there are only 20 bytes"));
    assert!(self::message(format!("{META}ElementDataFile = all.raw").as_bytes()).contains("no folder"));
}

#[test]
fn malformed_headers_say_where() {
    let meta = |from: &str, to: &str| message(format!("{META}ElementDataFile = LOCAL\n").replace(from, to).as_bytes());
    assert!(
        meta("3 2 2", "3 2").contains("line 3: expected the size of a volume in 3 dimensions, found `dimsize: 3 2`")
    );
    assert!(meta("3 2 2", "3 2 x").contains("line 3: expected whole numbers"));
    assert!(meta("2 .5 4", "2 .5").contains("line 4: expected 3 numbers"));
    assert!(meta("2 .5 4", "2 0 4").contains("do not span a space"));
    assert!(meta("MET_SHORT", "MET_STRING").contains("line 7: expected a type"));
    assert!(meta("3 2 2", "0 2 2").contains("is none that a volume can have"));
    // Sizes that no file has are refused before anything is allocated.
    assert!(meta("3 2 2", "3000000 2000000 2").contains("there are only 0 bytes"));
    assert!(meta("3 2 2", "9000000000000000000 9000000000000000000 9").contains("none that a volume can have"));
    assert!(meta("ElementDataFile = LOCAL", "").contains("no `ElementDataFile`"));
    let nrrd =
        |from: &str, to: &str| message(format!("{NRRD}endian: big\nencoding: raw\n\n").replace(from, to).as_bytes());
    assert!(nrrd("type: short", "type: block").contains("line 3: expected a type"));
    assert!(nrrd("encoding: raw", "encoding: bzip2").contains("line 11: bzip2 is not known"));
    assert!(nrrd("sizes: 3 2 2", "sizes: 3 2").contains("as many sizes"));
    assert!(nrrd("(0,2,0)", "(0,2").contains("line 8: expected vectors"));
    assert!(nrrd("\n\n", "\n").contains("the header does not end"));
    assert!(nrrd("endian: big\n", "").contains("no `endian`"));
    assert!(message(b"").contains("the file is empty"));
    assert!(message(b"hello").contains("--raw 256x256x128:u16le"));
}

/// Every prefix and every changed byte of a file gives a volume or an error, and soon.
#[test]
fn damaged_files_never_panic() {
    let with = |head: &str, tail: &str| [head.as_bytes(), tail.as_bytes(), &data(false)].concat();
    for file in [with(META, "ElementDataFile = LOCAL\n"), with(NRRD, "endian: little\nencoding: raw\n\n")] {
        for i in 0..file.len() {
            let _ = read(&file[..i]);
            for change in [0, b'9', b' ', b'\n', 0xff] {
                let mut changed = file.clone();
                changed[i] = change;
                let _ = read(&changed);
            }
        }
    }
}

#[cfg(feature = "volumes")]
mod packed {
    use super::*;
    use flate2::Compression;
    use flate2::write::{GzEncoder, ZlibEncoder};
    use std::io::Write;

    fn zlib(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    fn gzip(bytes: &[u8]) -> Vec<u8> {
        let mut encoder = GzEncoder::new(Vec::new(), Compression::default());
        encoder.write_all(bytes).unwrap();
        encoder.finish().unwrap()
    }

    fn base64(bytes: &[u8]) -> String {
        const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
        let chunk = |chunk: &[u8]| {
            let word = chunk.iter().chain(&[0, 0]).take(3).fold(0, |word, &b| word << 8 | u32::from(b));
            let letter = |i: usize| {
                if i > chunk.len() { '=' } else { char::from(LETTERS[(word >> (18 - 6 * i) & 63) as usize]) }
            };
            (0..4).map(letter).collect::<String>()
        };
        bytes.chunks(3).map(chunk).collect()
    }

    #[test]
    fn packed_data_are_unpacked() {
        let meta = |data: &[u8]| [META.as_bytes(), b"CompressedData = True\nElementDataFile = LOCAL\n", data].concat();
        let nrrd = |data: &[u8]| [NRRD.as_bytes(), b"endian: little\nencoding: gzip\nbyte skip: 3\n\n", data].concat();
        assert_eq!(read(&meta(&zlib(&data(false)))).unwrap().image, image());
        assert_eq!(read(&nrrd(&gzip(&[b"abc", &data(false)[..]].concat()))).unwrap().image, image());
        let whole = gzip(&[META.as_bytes(), b"ElementDataFile = LOCAL\n", &data(false)].concat());
        assert_eq!(read(&whole).unwrap().image, image());
        assert!(message(&meta(b"no zlib at all, but rather long for it")).contains("packed data are damaged"));
        assert!(message(&meta(&zlib(&data(false)[..20]))).contains("take 24 bytes, packed, and no more than 20"));
        let cut = zlib(&data(false));
        assert!(message(&meta(&cut[..cut.len() - 8])).contains("t: "));
        let huge = META.replace("3 2 2", "3000 2000 2000") + "CompressedData = True\nElementDataFile = LOCAL\n";
        assert!(message(&[huge.as_bytes(), &zlib(&[0; 1000])].concat()).contains("samples of the type i16 take"));
        // As a whole, too: little can be in little.
        let huge = gzip((META.replace("3 2 2", "3000 2000 2000") + "ElementDataFile = LOCAL\n").as_bytes());
        assert!(message(&huge).contains("take 24000000000 bytes"));
    }

    /// A file with two arrays, the second one of which is `data`.
    fn vti(head: &str, array: &str, appended: &[u8]) -> Vec<u8> {
        let text = format!(
            "<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\" version=\"1.0\" {head}>\n\
             <ImageData WholeExtent=\"1 3 0 1 -1 0\" Origin=\"2 -4 4.1\" Spacing=\"2 .5 4\" Direction=\"0 -1 0 1 0 0 0 0 1\">\n\
             <Piece Extent=\"1 3 0 1 -1 0\"><PointData Scalars=\"b\">\n\
             <DataArray type=\"UInt8\" Name=\"a\" NumberOfComponents=\"2\" format=\"ascii\">\n\
             0 1 2 3 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23</DataArray>\n{array}\n\
             </PointData></Piece></ImageData>\n"
        );
        [text.as_bytes(), appended, b"</VTKFile>"].concat()
    }

    fn array(format: &str, content: &str) -> String {
        format!("<DataArray type=\"Int16\" Name=\"b\" {format}>{content}</DataArray>")
    }

    /// The data in blocks of 10 bytes, each packed: sizes and data.
    fn blocks(big: bool, wide: bool) -> [Vec<u8>; 2] {
        let data = data(big);
        let blocks: Vec<Vec<u8>> = data.chunks(10).map(zlib).collect();
        let sizes = [3, 10, 4].into_iter().chain(blocks.iter().map(|block| block.len() as u64));
        [sizes.flat_map(|size| word(size, big, wide)).collect(), blocks.concat()]
    }

    fn word(size: u64, big: bool, wide: bool) -> Vec<u8> {
        let mut bytes = size.to_le_bytes()[..if wide { 8 } else { 4 }].to_vec();
        if big {
            bytes.reverse();
        }
        bytes
    }

    #[test]
    fn xml_images_are_read_in_all_their_ways() {
        let text = numbers().iter().map(i16::to_string).collect::<Vec<_>>().join(" ");
        let mut files = vec![vti("", &array("format=\"ascii\"", &text), b"")];
        for (big, wide) in [(false, false), (false, true), (true, false), (true, true)] {
            let head = format!(
                "byte_order=\"{}Endian\" header_type=\"UInt{}\"",
                if big { "Big" } else { "Little" },
                if wide { 64 } else { 32 }
            );
            let plain = [word(24, big, wide), data(big)].concat();
            files.push(vti(&head, &array("format=\"binary\"", &format!("\n {}\n ", base64(&plain))), b""));
            let appended = |encoding: &str, data: &[u8]| {
                let head = format!("<AppendedData encoding=\"{encoding}\">\n _....");
                [head.as_bytes(), data, b"\n</AppendedData>"].concat()
            };
            let there = array("format=\"appended\" offset=\"4\"", "");
            files.push(vti(&head, &there, &appended("base64", base64(&plain).as_bytes())));
            files.push(vti(&head, &there, &appended("raw", &plain)));
            let head = format!("{head} compressor=\"vtkZLibDataCompressor\"");
            let [sizes, blocks] = blocks(big, wide);
            let letters = base64(&sizes) + &base64(&blocks);
            files.push(vti(&head, &array("format=\"binary\"", &letters), b""));
            files.push(vti(&head, &there, &appended("base64", letters.as_bytes())));
            files.push(vti(&head, &there, &appended("raw", &[sizes, blocks].concat())));
        }
        for (i, file) in files.iter().enumerate() {
            let file = read(file).unwrap();
            assert_eq!(file.image.voxels(), image().voxels(), "{i}");
            let at = file.image.placement();
            assert_eq!(at.axes, placement().axes);
            assert!((at.origin - DVec3::new(2.0, -2.0, 0.1)).length() < 1e-12, "{at:?}");
            assert_eq!((file.info.array.as_deref(), file.info.arrays.len()), (Some("b"), 2));
        }
        let options = |array: &str, channel| VolumeOptions { array: Some(array.to_owned()), channel, raw: None };
        let second = read_volume_bytes("t", &files[0], &options("a", Some(1)), &Silent).unwrap().image;
        assert_eq!(second.voxels(), &Voxels::U8((0..12).map(|i| 2 * i + 1).collect()));
        let fails = |options| read_volume_bytes("t", &files[0], &options, &Silent).unwrap_err().to_string();
        assert!(fails(options("a", None)).contains("--channel 0"));
        assert!(fails(options("c", None)).ends_with("there are: a, b"));
        // Damaged: an error, or a volume, but nothing else.
        let file = files.last().unwrap();
        for i in 0..file.len() {
            assert!(read(&file[..i]).is_err() || i > file.len() - 40);
            let mut changed = file.clone();
            changed[i] = changed[i].wrapping_add(1);
            let _ = read(&changed);
        }
    }

    #[test]
    fn other_xml_is_refused_with_a_remedy() {
        let array = array("format=\"ascii\"", "1 2 3");
        assert!(message(&vti("", &array, b"")).contains("cannot be in its 5 bytes"));
        let other = |from: &str, to: &str| {
            message(String::from_utf8(vti("", &array, b"")).unwrap().replace(from, to).as_bytes())
        };
        assert!(other("ImageData\"", "PolyData\"").contains("the file holds PolyData, not ImageData; save"));
        assert!(other("1 3 0 1 -1 0", "3 1 0 1 -1 0").contains("holds no point"));
        assert!(other("</Piece>", "</Piece><Piece/>").contains("in several pieces"));
        let lz4 = message(&vti("compressor=\"vtkLZ4DataCompressor\"", &array, b""));
        assert!(lz4.contains("vtkLZ4DataCompressor, which is not known: save them with zlib"));
    }
}
