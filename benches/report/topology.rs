//! Thinning, spanning forest, and all handles cut.

use super::markdown::{number, table, times};
use super::measure::{Cost, Effort, measure, on_threads};
use super::pointer_octree::blocks::Blocks;
use super::pointer_octree::cell_map::{CellMap, HashCells, TreeCells, hash_cells};
use super::pointer_octree::elements::{TopoMemory, forget, prepare};
use super::pointer_octree::node::Tree;
use super::pointer_octree::{element_map, scan, sign, span, thin};
use super::svg::plot;
use super::{Plan, Report, input};
use zmend::octree::{EditedOctree, SignedOctree};
use zmend::progress::Silent;
use zmend::topology::{Complex, Loops, Options, Side, repair_topology, thin as zmend_thin};

const SAMPLES: [(&str, u32); 3] = [("torus", 1), ("knot", 2), ("noisy", 1)];

/// What one of the two takes, the octree's memory included.
#[derive(Clone, Copy, Default)]
struct Costs {
    thin: Cost,
    /// Skeleton, sizes, forest.
    span: f64,
    whole: Cost,
    removed: u64,
    handles: usize,
    /// Of all handles.
    size: f64,
}

fn of_zmend(effort: Effort, octree: &SignedOctree) -> Costs {
    let edited = EditedOctree::unedited(octree.clone());
    let bytes = octree.bytes() as f64;
    let mut removed = 0;
    let mut thin = measure(
        effort,
        || (),
        |()| {
            let mut complex = Complex::new(&edited, Side::Object);
            removed = zmend_thin(&mut complex, None, &Silent).expect("not cancelled").removed;
            complex
        },
    );
    let find = || Loops::find(&edited, Side::Object, f64::INFINITY, &Silent).expect("not cancelled");
    let found = measure(effort, || (), |()| find());
    let loops = find();
    let cut = Options { cut: Some(f64::INFINITY), ..Options::default() };
    let mut whole =
        measure(effort, || octree.clone(), |octree| repair_topology(octree, &cut, &Silent).expect("not cancelled"));
    thin.peak += bytes;
    whole.peak += bytes;
    let size = loops.handles().iter().map(|handle| handle.squares as f64).sum();
    Costs { thin, span: found.cpu - thin.cpu, whole, removed, handles: loops.handles().len(), size }
}

fn of_pointers(effort: Effort, name: &str, detail: u32, depth: u32) -> Costs {
    let (mesh, frame) = input(name, detail, depth);
    let (memory, records) = (TopoMemory::default(), Blocks::default());
    let tree = Tree::new(&memory, depth);
    scan::scan(&tree, &mut &mesh, &frame).expect("in memory");
    sign::sign_all(&tree);
    let anew = || {
        forget(&tree);
        prepare(&tree);
    };
    let mut removed = 0;
    let thinned = measure(effort, anew, |()| removed = thin::thin(&tree, &records).removed);
    // Records of all runs lie in the blocks: one run's are counted.
    let before = records.taken();
    anew();
    thin::thin(&tree, &records);
    let [leaves, inner] = memory.counts();
    let bytes = (32 * leaves + 96 * inner + 48 * (records.taken() - before)) as f64;
    let spanned = measure(effort, || (), |()| span::handles(&tree));
    let handles = span::handles(&tree);
    let whole = measure(effort, anew, |()| {
        let before = span::euler(&tree);
        thin::thin(&tree, &records);
        let handles = span::handles(&tree);
        span::cut(&tree, &handles);
        let after = span::euler(&tree);
        assert_eq!(after - before, handles.len() as i64, "a cut makes one handle less");
    });
    let peak = bytes + spanned.peak;
    Costs {
        thin: Cost { peak: bytes, ..thinned },
        span: spanned.cpu,
        whole: Cost { peak, ..whole },
        removed,
        handles: handles.len(),
        size: handles.iter().map(|handle| f64::from(handle.size)).sum(),
    }
}

fn thinned<M: CellMap<u32> + Clone>(effort: Effort, map: &M, depth: u32) -> Cost {
    measure(effort, || map.clone(), |mut map| element_map::thin(&mut map, depth))
}

/// Thinning with an entry an element: seconds and elements removed.
fn of_maps(plan: &Plan, name: &str, detail: u32, depth: u32) -> ([Cost; 2], u64) {
    let (mesh, frame) = input(name, detail, depth);
    let memory = super::pointer_octree::node::Memory::<()>::default();
    let tree = Tree::new(&memory, depth);
    scan::scan(&tree, &mut &mesh, &frame).expect("in memory");
    sign::sign_all(&tree);
    let mut filled: HashCells<u32> = hash_cells();
    element_map::fill(&tree, &mut filled);
    let ordered: TreeCells<u32> = filled.iter().map(|(&key, &removed)| (key, removed)).collect();
    let removed = element_map::thin(&mut filled.clone(), depth).removed;
    ([thinned(plan.effort, &filled, depth), thinned(plan.effort, &ordered, depth)], removed)
}

pub(crate) fn report(plan: &Plan, report: &mut Report) {
    let mut ratios = Vec::new();
    let mut absolute = Vec::new();
    let mut lines = Vec::new();
    for (name, detail) in SAMPLES {
        let mut line = [Vec::new(), Vec::new()];
        for depth in plan.topology.clone() {
            let (mesh, frame) = input(name, detail, depth);
            let scanned = zmend::sign::scan(&mut &mesh, &frame, false, &Silent).expect("in memory");
            let octree =
                zmend::sign::parity_signs(zmend::sign::close(scanned.crossings, &Silent).expect("in memory").0);
            let cells = octree.crossings().len() as f64;
            let zmend = on_threads(1, || of_zmend(plan.effort, &octree));
            let two = on_threads(2, || of_zmend(plan.effort, &octree));
            let pointer = on_threads(1, || of_pointers(plan.effort, name, detail, depth));
            let per_cell = |seconds: f64| 1e9 * seconds / cells;
            line[0].push((f64::from(depth), per_cell(zmend.whole.cpu)));
            line[1].push((f64::from(depth), per_cell(pointer.whole.cpu)));
            ratios.push(vec![
                name.to_owned(),
                depth.to_string(),
                times(pointer.whole.cpu / zmend.whole.cpu),
                times(pointer.whole.peak / zmend.whole.peak),
                times(pointer.thin.cpu / zmend.thin.cpu),
                times(pointer.span / zmend.span),
                times(pointer.whole.wall / two.whole.wall),
                format!("{}, {}", pointer.handles, zmend.handles),
                number(pointer.size / zmend.size),
            ]);
            absolute.push(vec![
                name.to_owned(),
                depth.to_string(),
                format!("{cells}"),
                number(per_cell(zmend.whole.cpu)),
                number(per_cell(pointer.whole.cpu)),
                number(zmend.whole.peak / cells),
                number(pointer.whole.peak / cells),
                number(1e9 * zmend.thin.cpu / zmend.removed as f64),
                number(1e9 * pointer.thin.cpu / pointer.removed as f64),
                number(zmend.removed as f64 / pointer.removed as f64),
            ]);
        }
        let [zmend, pointer] = line;
        lines.push((format!("{name}, zmend"), zmend));
        lines.push((format!("{name}, pointer"), pointer));
    }
    report.say("### Topology\n\nAll handles cut. How many times as much the pointer octree takes as zmend, one thread each (and \
                    zmend two, by the clock), and the handles that both find, with the sum of their sizes, pointer octree over zmend:\n\n");
    report.say(table(
        &["solid", "depth", "time", "memory", "thinning", "skeleton, sizes, forest", "2 threads", "handles", "sizes"],
        &ratios,
    ));
    report.say("\nIn ns and bytes a surface cell; and of thinning, in ns an element removed. zmend removes more, for it has no large \
                    leaves:\n\n");
    report.say(table(
        &[
            "solid",
            "depth",
            "surface cells",
            "zmend ns",
            "pointer ns",
            "zmend bytes",
            "pointer bytes",
            "zmend ns an element",
            "pointer ns an element",
            "elements, zmend over pointer",
        ],
        &absolute,
    ));
    report.say("\n");
    lines.truncate(4);
    let svg = plot("All handles cut, one thread", "depth", "ns a surface cell", &lines);
    report.plot(
        "topology-time.svg",
        "Time of a topology repair by depth: zmend takes less, but comes nearer with each level",
        svg,
    );
    maps(plan, report);
}

fn maps(plan: &Plan, report: &mut Report) {
    let depth = plan.elements;
    let (name, detail) = SAMPLES[1];
    let ([hash, ordered], removed) = on_threads(1, || of_maps(plan, name, detail, depth));
    let (mesh, frame) = input(name, detail, depth);
    let scanned = zmend::sign::scan(&mut &mesh, &frame, false, &Silent).expect("in memory");
    let octree = zmend::sign::parity_signs(zmend::sign::close(scanned.crossings, &Silent).expect("in memory").0);
    let zmend = on_threads(1, || of_zmend(plan.effort, &octree));
    let element = |cost: Cost, removed: u64| 1e9 * cost.cpu / removed as f64;
    let base = element(zmend.thin, zmend.removed);
    report.say(format!(
        "Thinning with an entry for each element of the solid, `{name}` at depth {depth}, in ns an element removed: {} in a hash table, {} times \
         what zmend takes ({}); {} in an ordered map, {} times.\n",
        number(element(hash, removed)),
        times(element(hash, removed) / base),
        number(base),
        number(element(ordered, removed)),
        times(element(ordered, removed) / base),
    ));
}
