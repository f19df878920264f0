"""A bridge to finite elements: meshes, decks, results. Arrays and text in, arrays and text out."""
