//! What the library promises whatever comes: damaged solids are repaired without one violation, any work stops when it is told to, and many
//! repairs at a time do not disturb each other. docs/guarantees.md lists all promises and what holds them.

#[path = "../common/mod.rs"]
mod common;

mod cancel;
mod damaged;
mod oracles;
mod solids;
mod supply;
mod together;

/// A number from the environment.
fn number(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().unwrap_or_else(|_| panic!("{name} is a number")))
}

fn pool(threads: usize) -> rayon::ThreadPool {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads")
}

/// Whether two meshes are the same, bit for bit.
fn is_same(a: &zmend::Mesh, b: &zmend::Mesh) -> bool {
    let bits =
        |mesh: &zmend::Mesh| -> Vec<u64> { mesh.points.iter().flat_map(|p| p.to_array().map(f64::to_bits)).collect() };
    a.faces == b.faces && bits(a) == bits(b)
}
