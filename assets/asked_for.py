"""Whether a run was started for a training. The button `Materialize all` makes everything else and trains nothing."""

from typing import Any

from assets.plan import SHARED, Plan


def asked_for(context: Any, plan: Plan) -> bool:
    """False, with a warning that says what to do, in a run that makes the motions as well as this training."""
    made = context.run.asset_selection or context.job_def.asset_layer.executable_asset_keys
    if SHARED[0].key not in made:
        return True
    name = plan.key.to_user_string()
    context.log.warning(
        f"'{name}' is not trained, and what is made of it is skipped: this run materializes everything. To train, "
        f"materialize '{name}' alone, or start its job."
    )
    return False
