//! Tables and drawings made by the program.
