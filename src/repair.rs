//! The pipeline: polygon soup in, closed manifold mesh out.
