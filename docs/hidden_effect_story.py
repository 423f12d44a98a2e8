"""Find a hidden effect in a script or a notebook: what ``hidden-effect.md`` tells, with ``import fingerlab``.

    python docs/hidden_effect_story.py FOLDER

Editors that know cells (``# %%``) run it piece by piece, and jupytext opens it as a notebook. Files go to
FOLDER, which is made where it is absent; a session that is there from an earlier run is used again.
"""

# %% The parts are functions, so that a test can run them; in a notebook call them one after the other.
from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import fingerlab


# %% 1. Hide an effect
def hide(folder: Path) -> Any:
    """A practice session with one effect sealed in it."""
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "session.h5"
    if path.exists():
        return fingerlab.open(path)
    return fingerlab.simulate(path, "rich", hidden=True, seed=7)


# %% 2. and 3. See how wrong the model is, and which effect would mend it
def look(session: Any, folder: Path) -> Any:
    """The diagnosis, with its figures in ``folder``."""
    diagnosis = session.diagnose()
    print(diagnosis, end="\n\n")
    if not (folder / "figures").exists():
        diagnosis.figures().save(folder / "figures")
    return diagnosis


# %% 4. Put it in, and look again
def again(session: Any, diagnosis: Any) -> Any:
    """The diagnosis of the model with the effects that the first one added."""
    second = session.diagnose(added=diagnosis.result.final_model, curves=False)
    print(second.result.verdict, f"{diagnosis.score:.2f} -> {second.score:.2f} floors", end="\n\n")
    return second


# %% 5. Does it predict better?
def predict(session: Any, diagnosis: Any) -> Any:
    """Endpoint force of the contact runs with the effect and without, each run left out of its fit."""
    model = diagnosis.fit()
    print(model, end="\n\n")
    prediction = model.predict(session)
    print(prediction, end="\n\n")
    return prediction


# %% 6. Open the seal
def tell(folder: Path) -> dict[str, Any]:
    """The whole story; returns what a test asks for."""
    session = hide(folder)
    print(session, end="\n\n")
    diagnosis = look(session, folder)
    second = again(session, diagnosis)
    prediction = predict(session, diagnosis)
    hidden = session.reveal()
    print("found:", ", ".join(diagnosis.missing), "- hidden:", ", ".join(hidden))
    return {"diagnosis": diagnosis, "again": second, "prediction": prediction, "hidden": hidden}


# %%
if __name__ == "__main__":
    tell(Path(sys.argv[1] if len(sys.argv) > 1 else "story"))
