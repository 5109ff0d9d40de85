// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The group actuator.can of rig.conf: a drive on a CAN bus. In libincise, as rig.conf is read where the
 * module is not, too.
 */
#include <math.h>
#include <stddef.h>
#include "../../rig/actuator.h"

#define US 1000.0 /* ns */
#define NS_PER_US 1000
#define SETTINGS_OF struct incise_actuator

/* The rates of serial adapters, which are also usual for can0. */
#define BITRATES                                                                  \
	"10000, 20000, 50000, 100000, 125000, 250000, 500000, 800000 or 1000000 " \
	"bit/s"

static bool is_bitrate(const double *rate, int n, const char *text)
{
	static const int rates[] = {0,	    10000,  20000,  50000,  100000,
				    125000, 250000, 500000, 800000, 1000000};

	(void)n;
	(void)text;
	for (size_t i = 0; i < sizeof(rates) / sizeof(*rates); i++)
		if (*rate == rates[i])
			return true;
	return false;
}

/*
 * An object of the interpolation period, 60C2, is a byte times a power of ten: 1.25 ms is
 * 125 of 10 µs. In this range each whole number of 10 µs is one, and nothing else.
 */
static bool is_cycle(const double *us, int n, const char *text)
{
	(void)n;
	(void)text;
	return fmod(*us, 10) == 0;
}

static const char *const modes[] = {
	[INCISE_ACTUATOR_CSP] = "csp",
	[INCISE_ACTUATOR_CSV] = "csv",
	[INCISE_ACTUATOR_CST] = "cst",
	NULL,
};

const struct incise_setting incise_actuator_can_settings[] = {
	SETTING_WORD(mode, can.mode, modes, "csp",
		     "kind of the setpoint: csp, csv or cst, see below"),
	SETTING_WHOLE(bitrate, can.bitrate, "bit/s", 0, 1000000, "0",
		      "bit rate of the bus, see below", .fits = is_bitrate,
		      .expected = BITRATES),
	SETTING_WHOLE(cycle_us, can.cycle_ns, "µs", 500, 2000, "1000",
		      "time between two SYNCs, a multiple of 10", .scale = US,
		      .fits = is_cycle,
		      .expected = "a multiple of 10 us from 500 to 2000"),
	SETTING_NUMBER(counts_per_turn, can.counts_per_turn, "1/turn", 1, 1e9,
		       "(from drive)", "units of position per turn of the screw"),
	SETTING_NUMBER(velocity_per_turn_s, can.velocity_per_turn_s, "s/turn", 1, 1e9,
		       "(from drive)", "units of velocity per turn/s, e.g. 60 for rpm"),
	SETTING_NUMBER(acceleration_per_turn_s2, can.acceleration_per_turn_s2, "s²/turn",
		       1, 1e9, "(from drive)", "units of acceleration per turn/s²"),
	SETTING_NUMBER(following_mm, can.following_mm, "mm", 0.001, 1000,
		       "(1, or travel_mm/10)",
		       "largest distance from the target; at most travel_mm"),
	SETTING_NUMBER(following_ms, can.following_s, "ms", 1, 10000, "50",
		       "longest time beyond following_mm", .scale = 1e-3),
	SETTING_NUMBER(start_ms, can.start_s, "ms", 10, 60000, "500",
		       "longest time from power on to operation enabled; a drive that "
		       "searches its commutation or opens a brake needs more",
		       .scale = 1e-3),
	SETTING_NUMBER(answer_ms, can.answer_s, "ms", 10, 2000, "200",
		       "longest time for the drive's answer to a request (SDO)",
		       .scale = 1e-3),
	SETTING_WHOLE(homing_method, can.homing_method, "", -128, 127, "0",
		      "number of the homing method in the drive's manual"),
	SETTING_TRUTH(absolute, can.absolute, "false",
		      "true if the encoder keeps its position without power"),
	SETTING_NUMBER(position_gain_1_s, can.position_gain_1_s, "1/s", 0.1, 10000, "20",
		       "csv: velocity per distance from the target"),
	SETTING_NUMBER(stiffness_permille_mm, can.stiffness_permille_mm, "‰/mm", 0.001,
		       1e6, "(cst: required)",
		       "cst: thousandths of the rated torque per mm from the target"),
	SETTING_NUMBER(damping_permille_s_mm, can.damping_permille_s_mm, "‰ s/mm", 0, 1e6,
		       "0",
		       "cst: thousandths of the rated torque per mm/s from the target "
		       "speed"),
	SETTING_NUMBER(torque_max_permille, can.torque_max_permille, "‰", 1, 1000,
		       "(cst: required)",
		       "cst: largest torque, in thousandths of the rated torque"),
	SETTING_WHOLE(master, can.master, "", 1, 127, "127",
		      "node id of this program's heartbeat; no other node may have it"),
	{0},
};

/*
 * In csv the loop of position is closed here, once per cycle T, which limits its gain:
 *
 *   SYNC n      position x[n] is sampled, and comes in a TPDO
 *   SYNC n + 1  brings the speed K (target - x[n])
 *   SYNC n + 2  the drive runs at it, until
 *   SYNC n + 3
 *
 * that is x[n+1] = x[n] + T K (target - x[n-d]) with d = 2; another cycle is left for what
 * drive and bus add. The roots of z^(d+1) - z^d + T K lie within the unit circle for
 *
 *   0 < T K < 2 sin(π / (2 (2d + 1)))
 *
 * (S. A. Levin and R. M. May, A note on difference-delay equations, Theor. Popul. Biol. 9,
 * 1976, who write 2 cos(d π / (2d + 1)), which is the same). Half of that is taken.
 */

#define DELAY_CYCLES 3

double incise_actuator_can_gain_1_s(double cycle_s)
{
	return sin(M_PI / (2 * (2 * DELAY_CYCLES + 1))) / cycle_s;
}

/* Keys that a mode requires, and combinations. */
int incise_actuator_can_check(const struct incise_actuator *actuator,
			      const config_setting_t *can, const char *path,
			      struct incise_error *err)
{
	const struct incise_actuator_can *is = &actuator->can;
	double most_1_s = incise_actuator_can_gain_1_s(is->cycle_ns * 1e-9);

	if (is->mode == INCISE_ACTUATOR_CST &&
	    !(is->stiffness_permille_mm && is->torque_max_permille))
		return incise_conf_error(can, "mode", path, err,
					 "a mode in which the drive closes the control "
					 "loops, or with it the keys "
					 "stiffness_permille_mm and torque_max_permille");
	if (is->following_mm > actuator->travel_mm)
		return incise_conf_error(can, "following_mm", path, err,
					 "at most travel_mm, %g", actuator->travel_mm);
	if (is->mode == INCISE_ACTUATOR_CSV && is->position_gain_1_s > most_1_s)
		return incise_conf_error(
			can, "position_gain_1_s", path, err,
			"at most %.1f 1/s, half of the stable limit with cycle_us = %u",
			floor(most_1_s * 10) / 10, is->cycle_ns / NS_PER_US);
	return 0;
}
