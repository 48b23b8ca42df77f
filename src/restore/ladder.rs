//! Model no more than a scene needs: rungs.
