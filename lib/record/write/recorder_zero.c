// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The zero of the force channel, measured while the tool is held free; see recorder.h.
 *
 *     force    |◄── 0.5 s: mean ──►|
 *     tracker      |◄── not in the tissue ──►|     comes later: up to 1 s is waited
 */
#include <errno.h>
#include <math.h>
#include "../read/cut.h"
#include "recorder.h"

/* The tool is to be held free for so long, for the zero of the force channel. */
#define ZERO_NS 500000000LL
/* A tracker that says nothing for twice that time has no say in it. */
#define ZERO_PATIENCE_NS (2 * ZERO_NS)
/* A free tool shows the noise of the channel, some mN; a touch shows tenths of N. */
#define ZERO_SD_MAX_N 0.03

/* So many codes are so many mV. */
static double span_mV(const struct incise_recorder *rec, double codes)
{
	return codes * rec->force_info.full_scale_V * 1e3 / (1LL << rec->force_info.bits);
}

double incise_recorder_code_mV(const struct incise_recorder *rec, double code)
{
	return rec->force_info.offset_V * 1e3 + span_mV(rec, code);
}

void incise_recorder_zero_force(struct incise_recorder *rec, int64_t t_ns, int32_t code,
				bool clipped)
{
	if (t_ns - rec->streams[INCISE_LEDGER_FORCE].first_ns >= ZERO_NS)
		return;
	rec->zero.n++;
	rec->zero.sum += code;
	rec->zero.sum2 += (int64_t)code * code;
	rec->zero.clipped |= clipped;
}

void incise_recorder_zero_depth(struct incise_recorder *rec, int64_t t_ns,
				double depth_mm)
{
	if (isnan(rec->stats.zero_mV) && rec->streams[INCISE_LEDGER_FORCE].begun &&
	    t_ns - rec->streams[INCISE_LEDGER_FORCE].first_ns < ZERO_NS)
		rec->zero.depth_max_mm = fmax(rec->zero.depth_max_mm, depth_mm);
}

int incise_recorder_settle_zero(struct incise_recorder *rec, struct incise_error *err)
{
	const struct incise_recorder_zero *zero = &rec->zero;
	const char *remedy =
		"hold the tool free for the first 0.5 s, or give force_zero_mV in "
		"the calibration";
	double mean = (double)zero->sum / zero->n;
	double var = fmax(0, (double)zero->sum2 / zero->n - mean * mean);
	double sd_mV = span_mV(rec, sqrt(var));
	double sd_N = sd_mV / fabs(rec->calibration.force_mV_N);

	rec->worthless = true;
	if (zero->depth_max_mm > INCISE_CUT_END_MM)
		return incise_error_set(
			err, EBUSY,
			"%s: the blade was %.1f mm deep while the zero of the "
			"force channel was measured; %s",
			rec->path, zero->depth_max_mm, remedy);
	if (zero->clipped)
		return incise_error_set(
			err, EBUSY,
			"%s: the force channel was at the end of its range while "
			"its zero was measured; check the amplifier; %s",
			rec->path, remedy);
	if (sd_N > ZERO_SD_MAX_N)
		return incise_error_set(
			err, EBUSY,
			"%s: the force varied by %.3f N (sd; up to %.2f is rest) "
			"while its zero was measured; %s",
			rec->path, sd_N, ZERO_SD_MAX_N, remedy);
	rec->worthless = false;
	rec->stats.zero_mV = incise_recorder_code_mV(rec, mean);
	if (incise_recorder_set_real(rec, "force_zero_mV", rec->stats.zero_mV) !=
		    SQLITE_OK ||
	    incise_recorder_set_real(rec, "force_zero_sd_mV", sd_mV) != SQLITE_OK ||
	    incise_recorder_set_integer(rec, "force_zero_samples", zero->n) !=
		    SQLITE_OK ||
	    incise_recorder_note(
		    rec, "zero", "force zero %.2f mV, sd %.2f mV over %lld samples",
		    rec->stats.zero_mV, sd_mV, (long long)zero->n) != SQLITE_OK)
		return incise_recorder_fail(rec, err);
	return 0;
}

/* The tracker's records come later than the force's: wait until it has had its say. */
bool incise_recorder_zero_due(const struct incise_recorder *rec)
{
	int64_t end_ns = rec->streams[INCISE_LEDGER_FORCE].first_ns + ZERO_NS;

	return isnan(rec->stats.zero_mV) && rec->streams[INCISE_LEDGER_FORCE].begun &&
	       rec->streams[INCISE_LEDGER_FORCE].timeline.last_ns >= end_ns &&
	       (rec->zero.tracker_ns >= end_ns ||
		rec->streams[INCISE_LEDGER_FORCE].timeline.last_ns >=
			rec->streams[INCISE_LEDGER_FORCE].first_ns + ZERO_PATIENCE_NS);
}
