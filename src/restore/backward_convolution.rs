//! Backward convolution by flip–FC–flip (Eqs. 9–12).
