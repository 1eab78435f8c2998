"""Physical effects that a model may lack: cards, blocks and changes of parameters, a file per place they enter."""
