//! [`Direction`]: the 26 ways from a cell to a neighbour.

use std::fmt;

use super::{Axis, Corner, Edge, Extent, Face};

/// One of the 26 directions from a cell to its neighbours: across a face, an edge or a corner.
///
/// ```
/// use zmend::grid::{Axis, Direction, Edge, Face};
///
/// assert_eq!(Direction::from(Face::new(Axis::Y, false)).steps(), [0, -1, 0]);
/// assert_eq!(Direction::from(Edge::ALL[6]).steps(), [1, 0, -1]);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Direction {
    /// The axes along which it moves, at least one.
    moves: Extent,
    /// Where it moves to the high side; a part of `moves`.
    high: Corner,
}

impl Direction {
    /// All 26, by increasing step in x, then y, then z.
    pub const ALL: [Direction; 26] = {
        let mut all = [Direction { moves: Extent(0), high: Corner(0) }; 26];
        let mut i = 0;
        while i < 26 {
            let n = if i < 13 { i } else { i + 1 }; // 13 is the step [0, 0, 0]
            let steps = [n / 9, n / 3 % 3, n % 3];
            let mut a = 0;
            while a < 3 {
                let bit = Axis::ALL[a].bit();
                if steps[a] != 1 {
                    all[i].moves.0 |= bit;
                }
                if steps[a] == 2 {
                    all[i].high.0 |= bit;
                }
                a += 1;
            }
            i += 1;
        }
        all
    };

    /// The direction with these steps of -1, 0 or 1 along x, y, z, or `None` for anything else and for `[0, 0, 0]`.
    pub const fn from_steps(steps: [i32; 3]) -> Option<Direction> {
        let mut direction = Direction { moves: Extent(0), high: Corner(0) };
        let mut a = 0;
        while a < 3 {
            let bit = Axis::ALL[a].bit();
            match steps[a] {
                0 => {}
                -1 => direction.moves.0 |= bit,
                1 => {
                    direction.moves.0 |= bit;
                    direction.high.0 |= bit;
                }
                _ => return None,
            }
            a += 1;
        }
        if direction.moves.0 == 0 { None } else { Some(direction) }
    }

    /// The step along `axis`: -1, 0 or 1.
    pub const fn step(self, axis: Axis) -> i32 {
        self.moves.contains(axis) as i32 * if self.high.is_high(axis) { 1 } else { -1 }
    }

    /// The steps along x, y, z.
    pub const fn steps(self) -> [i32; 3] {
        [self.step(Axis::X), self.step(Axis::Y), self.step(Axis::Z)]
    }

    /// The axes along which it moves.
    pub const fn moves(self) -> Extent {
        self.moves
    }

    /// What the two cells share: a face (two axes), an edge (one) or a point (none).
    pub const fn shared(self) -> Extent {
        self.moves.complement()
    }

    /// The first of the corners it points at: the one on the low side of the axes along which it does not move.
    pub const fn corner(self) -> Corner {
        self.high
    }

    /// Back.
    #[must_use]
    pub const fn opposite(self) -> Direction {
        Direction { moves: self.moves, high: Corner(self.high.0 ^ self.moves.0) }
    }
}

impl From<Face> for Direction {
    fn from(face: Face) -> Direction {
        let bit = face.axis().bit();
        Direction { moves: Extent(bit), high: Corner(if face.is_high() { bit } else { 0 }) }
    }
}

impl From<Edge> for Direction {
    fn from(edge: Edge) -> Direction {
        Direction { moves: Extent(edge.axis().bit()).complement(), high: edge.corners()[0] }
    }
}

impl From<Corner> for Direction {
    fn from(corner: Corner) -> Direction {
        Direction { moves: Extent::CELL, high: corner }
    }
}

/// The axes with their signs: `+x`, `-y+z`.
impl fmt::Display for Direction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for axis in self.moves.axes() {
            write!(f, "{}{axis}", if self.high & axis { '+' } else { '-' })?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_point_at_faces_edges_and_corners() {
        assert!(Direction::ALL.is_sorted_by_key(|d| d.steps()));
        for d in Direction::ALL {
            assert_eq!(Direction::from_steps(d.steps()), Some(d));
            assert_eq!(d.opposite().steps(), d.steps().map(|s| -s));
            assert_eq!(d.moves().dimension() + d.shared().dimension(), 3);
        }
        let mut named: Vec<Direction> = Face::ALL.map(Direction::from).to_vec();
        named.extend(Edge::ALL.map(Direction::from));
        named.extend(Corner::ALL.map(Direction::from));
        named.sort_by_key(|d| d.steps());
        assert_eq!(named, Direction::ALL);
        for e in Edge::ALL {
            let sum = e.faces().map(|f| Direction::from(f).steps());
            assert_eq!([0, 1, 2].map(|i| sum[0][i] + sum[1][i]), Direction::from(e).steps());
        }
        assert_eq!(Direction::from_steps([0; 3]), None);
        assert_eq!(Direction::from_steps([0, 2, 0]), None);
        assert_eq!(Direction::from(Edge::ALL[6]).to_string(), "+x-z");
    }
}
