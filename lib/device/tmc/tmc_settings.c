// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The group actuator.tmc of rig.conf: currents and modes of a driver chip. In libincise, as rig.conf is
 * read where the module is not, too.
 */
#include <string.h>
#include "../../rig/actuator.h"

#define SETTINGS_OF struct incise_actuator

const struct incise_setting incise_actuator_tmc_settings[] = {
	SETTING_NUMBER(sense_ohm, tmc.sense_ohm, "Ω", 0.01, 1, "(required)",
		       "sense resistor on the board of the chip"),
	SETTING_NUMBER(run_A, tmc.run_A, "A", 0.01, 20, "(required)",
		       "current of a phase in motion, root mean square"),
	SETTING_NUMBER(hold_A, tmc.hold_A, "A", 0.01, 20, "(half of run_A)",
		       "current at rest; at most run_A"),
	SETTING_TRUTH(interpolate, tmc.interpolate, "true",
		      "divide each microstep into parts of 1/256 step"),
	SETTING_TRUTH(stealthchop, tmc.stealthchop, "true",
		      "true: StealthChop, quiet; false: SpreadCycle"),
	SETTING_NUMBER(stealthchop_mm_s, tmc.stealthchop_mm_s, "mm/s", 0, 10000, "0",
		       "speed above which SpreadCycle replaces StealthChop; 0: never"),
	SETTING_NUMBER(stall_mm_s, tmc.stall_mm_s, "mm/s", 0, 10000, "0",
		       "speed from which on StallGuard counts; 0: never"),
	SETTING_WHOLE(stall_threshold, tmc.stall_threshold, "", -64, 255, "0",
		      "threshold of StallGuard, from 'incise stepper tune'"),
	SETTING_TRUTH(stall_home, tmc.stall_home, "false",
		      "true if the output DIAG is wired to the home input: a stall is "
		      "the edge and no fault"),
	SETTING_NUMBER(
		answer_ms, tmc.answer_s, "ms", 5, 10000, "50",
		"longest time for an answer of a TMC2209; on the line it takes 1 ms"),
	{0},
};

int incise_actuator_tmc_check(struct incise_actuator *actuator,
			      const config_setting_t *group, const char *path,
			      struct incise_error *err)
{
	const config_setting_t *tmc = config_setting_get_member(group, "tmc");
	struct incise_actuator_tmc *is = &actuator->tmc;
	int n = actuator->microsteps;

	if (strncmp(actuator->driver, "tmc", 3))
		return 0;
	if (!tmc)
		return incise_conf_error(
			group, "driver", path, err,
			"beside it the group tmc, with sense_ohm and run_A");
	if (n > 256 || n & (n - 1))
		return incise_conf_error(
			group, "microsteps", path, err,
			"a power of two up to 256, as the chip has them");
	if (!is->hold_A)
		is->hold_A = is->run_A / 2;
	if (is->hold_A > is->run_A)
		return incise_conf_error(tmc, "hold_A", path, err, "at most run_A, %g",
					 is->run_A);
	if (is->stall_home &&
	    !(is->stall_mm_s > 0 && is->stall_mm_s < actuator->home_mm_s))
		return incise_conf_error(tmc, "stall_mm_s", path, err,
					 "more than 0 and less than home_mm_s, %g, as "
					 "stall_home is true",
					 actuator->home_mm_s);
	return 0;
}
