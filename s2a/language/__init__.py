"""Language (satellite): objects inserted by a model's script, and sentences turned into skills.

In: a room, an object or a sentence, a model. Out: a checked layer over the room, or an executed plan.
"""
