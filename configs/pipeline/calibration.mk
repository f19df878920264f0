# From a finger's geometry to all of its states: finite elements of its dome and its hinge, springs
# fitted to them, every stable state with its uncertainty. Needs CalculiX (ccx) for what is out of
# date: make -f calibration.mk
DPG ?= dpg
OUT ?= calibrated
SPEC ?= ../three_unit.yaml
MESH ?= coarse
# How far a unit opens where its dome rests inverted, mm (assumed: dome height - unit separation).
STROKE ?= 3.5
DPG_VERSION := $(shell $(DPG) --version)
export SPEC MESH STROKE DPG_VERSION

# Make's own rules would write a spec `finger` anew from a `finger.sh` beside it. A link
# set to another file is newer than that file may be.
MAKEFLAGS += --no-builtin-rules --check-symlink-times

.DELETE_ON_ERROR:
.PHONY: all clean force
all: $(OUT)/states.parquet

$(OUT)/dome/dome.csv: $(SPEC) $(OUT)/SPEC.value $(OUT)/MESH.value $(OUT)/DPG_VERSION.value
	$(DPG) fe dome $(SPEC) --output $(@D) --mesh $(MESH) --run

$(OUT)/hinge/hinge.csv: $(SPEC) $(OUT)/SPEC.value $(OUT)/MESH.value $(OUT)/DPG_VERSION.value
	$(DPG) fe hinge $(SPEC) --output $(@D) --mesh $(MESH) --run

$(OUT)/dome.yaml: $(OUT)/dome/dome.csv $(OUT)/STROKE.value
	$(DPG) fit bistable $< --spec $(SPEC) --travel-to-opening stroke:$(STROKE) \
	  --branches quasi-static --output $@

$(OUT)/hinge.yaml: $(OUT)/hinge/hinge.csv
	$(DPG) fit hinge $< --spec $(SPEC) --output $@

$(OUT)/states.parquet: $(SPEC) $(OUT)/dome.yaml $(OUT)/hinge.yaml
	$(DPG) predict $(SPEC) --set 'finger.calibration=[$(OUT)/dome.yaml, $(OUT)/hinge.yaml]' \
	  --uncertainty --output $@

# What a variable was: written where it changes, so that what was made with another is made anew.
$(OUT)/%.value: force | $(OUT)
	@printf '%s\n' "$$$*" | cmp -s - $@ || printf '%s\n' "$$$*" > $@

$(OUT):
	mkdir -p $@

clean:
	rm -rf $(OUT)
