"""The paper's experiments (§5, §6), run again on ROOM and ATRIUM: one module a question."""
