"""What `--help` of each command ends with; tests run every line.

`finger.yaml` is what `dpg init` writes; other files are the user's own, or made by an example.
"""

EXAMPLES = {
    "predict": (
        "dpg predict finger.yaml",
        "dpg predict finger.yaml --pattern '1*' --set finger.geometry.unit_separation_mm=2.5",
        "dpg predict finger.yaml --output states.parquet --plot states.svg",
        "dpg predict finger.yaml --format csv > states.csv",
        "dpg predict finger.yaml --columns barriers",
    ),
    "explain": (
        "dpg explain finger.yaml",
        "dpg explain sweep.yaml",
        "dpg explain goal.yaml",
        "dpg explain finger.yaml --columns default,stiffness --target-error 0.01mm",
    ),
    "sweep": (
        "dpg sweep sweep.yaml --output out",
        "dpg sweep sweep.yaml --output part1 --shard 1/2",
        'dpg sweep sweep.yaml --output out --require "n_stable >= 8"',
    ),
    "merge": ("dpg merge part1 part2 --output whole",),
    "check": (
        'dpg check out/designs.parquet --require "reach_max_mm > 30"',
        'dpg check out/designs.parquet --require "n_stable >= 8" --summary-file summary.md',
    ),
    "pick": (
        'dpg pick out --where "min_barrier_mJ > 1" --maximize reach_max_mm --top 5',
        "dpg pick out --minimize reach_min_mm --maximize reach_max_mm --spec best.yaml",
        "dpg pick out --states --minimize tip_y_mm --top 3 --format csv",
    ),
    "report": ("dpg report out", "dpg report out --output page.html"),
    "design": (
        "dpg design goal.yaml",
        "dpg design goal.yaml --output found --seed 2",
        "dpg design goal.yaml --evaluations 5000 --format csv > designs.csv",
        "dpg design goal.yaml --output found --jobs 2",
    ),
    "bench": (
        "dpg bench finger.yaml",
        "dpg bench finger.yaml --target-error 0.01mm --repeats 1 --plot error.svg",
    ),
    "compare": (
        "dpg compare finger.yaml tips.csv",
        "dpg compare finger.yaml tips.csv --first-station 0.75,0 --plot tips.svg",
    ),
    "stress": (
        "dpg stress finger.yaml",
        "dpg stress --only crossed --format csv > cases.csv",
    ),
    "actuate": (
        "dpg actuate finger.yaml --pressure 0:0.15:0",
        "dpg actuate finger.yaml --pressure 0:0.2:-0.1:0 --output path.parquet --plot path.svg",
        "dpg actuate finger.yaml --from 110 --pressure 0:0.2:0 --cycles 100 --format csv",
    ),
    "transitions": (
        "dpg transitions finger.yaml",
        "dpg transitions finger.yaml --set 'pressure.lines={A: 1-2, B: 3}' --graph states.graphml",
        "dpg transitions finger.yaml --output transitions.parquet --plot states.svg",
    ),
    "landscape": (
        "dpg landscape finger.yaml --from 000 --to 111",
        "dpg landscape finger.yaml --from 000 --to 111 --via 001 --plot landscape.svg",
    ),
    "grasp": (
        "dpg grasp gripper.yaml --object disc:40 --at 40,0",
        "dpg grasp gripper.yaml --object disc:40 --at 40,0 --pattern 111* --plot grasps.svg",
        "dpg grasp gripper.yaml --object disc:40 --at 40,5 --pattern 11111/11100",
        "dpg grasp gripper.yaml --object disc:40 --at 40,0 --approach close --pressure 0:0.16:0",
        "dpg grasp gripper.yaml --pattern 110* --pattern 11111/01111 --plot meeting.svg",
    ),
    "pulses": (
        "dpg pulses finger.yaml --to 111",
        "dpg pulses finger.yaml --to 110 --set 'pressure.lines={A: 1-2, B: 3}'",
        "dpg pulses finger.yaml --table --from 111 --format csv > pulses.csv",
    ),
    "routine": (
        "dpg routine gripper.yaml --object disc:50 --at 45,0 --approach-from 110,0",
        "dpg routine gripper.yaml --object disc:50 --at 45,0 --approach-from 110,0 "
        "--controller routine.csv --plot strip.svg",
    ),
    "validate": (
        "dpg validate finger.yaml sweep.yaml",
        "dpg validate finger.yaml --format github",
    ),
    "init": (
        "dpg init",
        "dpg init my_finger.yaml",
        "dpg init --gripper",
        "dpg init --sweep heights.yaml",
    ),
    "help": ("dpg help", "dpg help tutorial"),
    "schema": ("dpg schema > finger.schema.json",),
    "fit bistable": (
        "dpg fit bistable dome.csv --travel-to-opening stroke:3.5 --spec finger.yaml",
        "dpg fit bistable dome.csv --travel-to-opening equal --bootstrap 100 --output dome.yaml",
    ),
    "fit unit": ("dpg fit unit unit.csv --spec finger.yaml --output unit.yaml",),
    "fit hinge": ("dpg fit hinge hinge.csv --spec finger.yaml --output hinge.yaml",),
    "fit finger": (
        "dpg fit finger finger.yaml tips.csv --output height.yaml",
        "dpg fit finger finger.yaml tips.csv --free hinge_stiffness_N_mm_per_rad",
    ),
    "fit grid": ("dpg fit grid domes.csv --geometry elastic_modulus_MPa=26 --output grid.yaml",),
    "fe dome": (
        "dpg fe dome finger.yaml --output deck",
        "dpg fe dome finger.yaml --output deck --mesh coarse --run",
    ),
    "fe hinge": ("dpg fe hinge finger.yaml --output deck --mesh coarse --run",),
    "fe unit": ("dpg fe unit finger.yaml --output deck --mesh coarse --run",),
    "fe finger": (
        "dpg fe finger finger.yaml --output deck --mesh coarse --run",
        "dpg fe finger finger.yaml --output deck --pattern '1?1' --run",
    ),
}
