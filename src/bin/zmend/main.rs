//! The program.
use zmend::*;
fn main() -> Result<()> {
    let a: Vec<String> = std::env::args().collect();
    let mut input = zmend::io::open(&a[1])?;
    let surface = match a[4].as_str() {
        "mc" => Surface::MarchingCubes,
        "dc" => Surface::DualContouring,
        _ => Surface::Quads,
    };
    let mut out = zmend::io::create(&a[2], zmend::io::Format::from_path(&a[2]).unwrap(), Default::default())?;
    let r = repair_into(
        &mut input,
        &Options { depth: a[3].parse().unwrap(), surface, ..Options::default() },
        &mut out,
        &zmend::progress::Silent,
    )?;
    let t = std::time::Instant::now();
    out.finish()?;
    println!("{r:#?} {:?}", t.elapsed());
    Ok(())
}
