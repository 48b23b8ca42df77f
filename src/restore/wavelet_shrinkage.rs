//! The paper's prior (Eqs. 3 and 6): soft shrinkage of wavelet details, plain and cycle-spun.
