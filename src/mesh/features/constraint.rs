//! Edges that somebody wants to keep.

use super::Chain;
use crate::error::{Error, Result};
use crate::mesh::{EdgeKey, Topology};
use ahash::RandomState;
use hashbrown::HashMap;

/// A chain of edges with a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Constraint {
    /// Its edges.
    pub chain: Chain,
    /// What it is called; may be empty.
    pub label: String,
}

/// Chains of edges of one mesh, no edge in two of them. Numbers of constraints stay when others are removed, and are never used again.
#[derive(Debug, Clone)]
pub struct Constraints {
    list: Vec<Option<Constraint>>,
    /// Which constraint an edge belongs to. Looked up, never read in its own order.
    edges: HashMap<EdgeKey, u32, RandomState>,
}

impl Default for Constraints {
    fn default() -> Self {
        Constraints { list: Vec::new(), edges: HashMap::with_hasher(RandomState::with_seeds(5, 6, 7, 8)) }
    }
}

impl Constraints {
    /// No constraints.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a chain and returns its number.
    ///
    /// # Errors
    /// When it has fewer than two points (three, if it is closed), visits a point twice, has a piece that is no edge of the mesh or that
    /// belongs to another constraint. Nothing is added then.
    pub fn add(&mut self, topology: &Topology<'_>, chain: Chain, label: impl Into<String>) -> Result<u32> {
        let refuse = |problem: String| Err(Error::setting("constraint", problem, "name a chain of free edges"));
        let least = if chain.is_closed { 3 } else { 2 };
        if chain.points.len() < least {
            return refuse(format!("{} points are fewer than {least}", chain.points.len()));
        }
        let mut sorted = chain.points.clone();
        sorted.sort_unstable();
        if let Some(&[twice, ..]) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            return refuse(format!("point {twice} comes twice"));
        }
        for [a, b] in chain.pieces() {
            if topology.find(a, b).is_none() {
                return refuse(format!("{a}-{b} is no edge of the mesh"));
            }
            if let Some(other) = self.of_edge(a, b) {
                return refuse(format!("edge {a}-{b} belongs to constraint {other}"));
            }
        }
        let number = self.list.len() as u32;
        chain.pieces().for_each(|[a, b]| _ = self.edges.insert(EdgeKey::new(a, b), number));
        self.list.push(Some(Constraint { chain, label: label.into() }));
        Ok(number)
    }

    /// Adds edges, each given by a side, as chains; those that belong to a constraint already are left out. Returns how many chains
    /// these are.
    pub fn add_edges(&mut self, topology: &Topology<'_>, sides: &[u32], label: &str) -> usize {
        let free = |&side: &u32| {
            let [a, b] = topology.ends(side);
            self.of_edge(a, b).is_none()
        };
        let free: Vec<u32> = sides.iter().copied().filter(free).collect();
        let chains = super::chains(topology, &free);
        let count = chains.len();
        for chain in chains {
            let number = self.list.len() as u32;
            chain.pieces().for_each(|[a, b]| _ = self.edges.insert(EdgeKey::new(a, b), number));
            self.list.push(Some(Constraint { chain, label: label.to_owned() }));
        }
        count
    }

    /// Removes a constraint, if it is there.
    pub fn remove(&mut self, number: u32) -> Option<Constraint> {
        let removed = self.list.get_mut(number as usize)?.take()?;
        removed.chain.pieces().for_each(|[a, b]| _ = self.edges.remove(&EdgeKey::new(a, b)));
        Some(removed)
    }

    /// The constraint of an edge.
    pub fn of_edge(&self, a: u32, b: u32) -> Option<u32> {
        self.edges.get(&EdgeKey::new(a, b)).copied()
    }

    /// A constraint by its number.
    pub fn get(&self, number: u32) -> Option<&Constraint> {
        self.list.get(number as usize)?.as_ref()
    }

    /// All constraints with their numbers, ascending.
    pub fn iter(&self) -> impl Iterator<Item = (u32, &Constraint)> {
        (0..).zip(&self.list).filter_map(|(i, constraint)| Some((i, constraint.as_ref()?)))
    }

    /// The constraints through a point, ascending. O(all).
    pub fn at_point(&self, point: u32) -> impl Iterator<Item = u32> + '_ {
        self.iter().filter(move |(_, constraint)| constraint.chain.points.contains(&point)).map(|(i, _)| i)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::sample;

    /// Bug C4.11: chains were taken without looking: too short, with points twice, with pieces that others had.
    #[test]
    fn chains_are_looked_at() {
        let cube = sample::build("cube", 1).unwrap();
        let topology = Topology::new(&cube);
        let mut constraints = Constraints::new();
        let face = cube.faces.get(0).to_vec();
        let of = |points: &[u32], is_closed| Chain { points: points.to_vec(), is_closed };
        for (bad, says) in [
            (of(&[], false), "0 points"),
            (of(&face[..1], false), "1 points"),
            (of(&face[..2], true), "2 points"),
            (of(&[face[0], face[1], face[0]], false), "twice"),
            (of(&[face[0], face[2]], false), "no edge"),
            (of(&[face[0], 99], false), "no edge"),
        ] {
            let message = constraints.add(&topology, bad, "").unwrap_err().to_string();
            assert!(message.contains(says), "{message}");
        }
        assert_eq!(constraints.iter().count(), 0);
        let rim = constraints.add(&topology, of(&face, true), "rim").unwrap();
        assert!(constraints.add(&topology, of(&[face[3], face[0]], false), "").is_err());
        assert_eq!(constraints.of_edge(face[0], face[3]), Some(rim));
        assert_eq!(constraints.at_point(face[2]).collect::<Vec<_>>(), [rim]);
        let all: Vec<u32> = topology.edges().collect();
        assert!(constraints.add_edges(&topology, &all, "rest") > 0);
        assert!(all.iter().all(|&s| constraints.of_edge(topology.ends(s)[0], topology.ends(s)[1]).is_some()));
        assert_eq!(constraints.remove(rim).unwrap().label, "rim");
        assert!(constraints.remove(rim).is_none() && constraints.get(rim).is_none());
        assert_eq!(constraints.of_edge(face[0], face[3]), None);
    }
}
