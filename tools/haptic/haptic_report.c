// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * What a run of the loop leaves; see haptic_report.h.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include "../cli/cli.h"
#include "haptic_report.h"
#include "../cli/json.h"
#include "../cli/loop_report.h"
#include "../stepper/status.h"

static const char *const phases[] = {"free", "cutting", "insertion"};

void haptic_write_log(struct incise_outfile *file, const struct incise_tick *ticks,
		      size_t n)
{
	struct incise_error err = {0};
	char flags[INCISE_TICK_FLAGS + 1];
	FILE *out;

	out = incise_outfile_stream(file);
	fputs("t_s,x_mm,y_mm,z_mm,depth_mm,velocity_mm_s,command_N,rendered_N,flags,phase,"
	      "command_x_N,command_y_N,command_z_N\n",
	      out);
	for (size_t i = 0; i < n; i++) {
		const struct incise_tick *t = &ticks[i];

		fprintf(out,
			"%.6f,%.4f,%.4f,%.4f,%.4f,%.3f,%.5f,%.5f,%s,%s,%.5f,%.5f,%.5f\n",
			(t->t_ns - ticks[0].t_ns) * 1e-9, t->position_mm[0],
			t->position_mm[1], t->position_mm[2], t->depth_mm,
			t->velocity_mm_s,
			sqrt(t->command_N[0] * t->command_N[0] +
			     t->command_N[1] * t->command_N[1] +
			     t->command_N[2] * t->command_N[2]),
			t->rendered_N, loop_flags_text(t->flags, flags), phases[t->phase],
			t->command_N[0], t->command_N[1], t->command_N[2]);
	}
	if (incise_outfile_commit(file, &err))
		cli_fail_with(&err);
}

void haptic_make_log(double duration_s, struct incise_loop_options *loop)
{
	double most = 0.5 * (double)sysconf(_SC_PHYS_PAGES) *
		      (double)sysconf(_SC_PAGESIZE) / sizeof(*loop->log);
	double ticks = ceil(duration_s * loop->rate_hz) + 1;

	if (ticks <= most)
		loop->log = calloc((size_t)ticks, sizeof(*loop->log));
	if (!loop->log)
		cli_fail("--log: no memory for %.0f ticks; a --duration of up to %.0f s "
			 "fits in half of it",
			 ticks, floor(most / loop->rate_hz));
	loop->log_size = (size_t)ticks;
	/* Touch the pages now: a fault in the loop is a late tick. */
	memset(loop->log, 0xff, loop->log_size * sizeof(*loop->log));
}

/* How far the actuator's force was from the one asked of it at the tick before, rms. */
static double render_error(const struct haptic *haptic)
{
	const struct incise_loop_stats *stats = haptic->stats;

	return incise_rig_stepper(haptic->rig) && stats->ticks > 1
		       ? sqrt(stats->rendered_off2 / (stats->ticks - 1))
		       : NAN;
}

static bool is_real(const struct haptic *haptic)
{
	return incise_clock_is_real(incise_rig_clock(haptic->rig));
}

static json_t *cost_json(const struct incise_loop_stats *s)
{
	return json_pack("{so so so}", "median",
			 json_number(loop_quantile(s->tick_100ns, 0.5, 100)), "p999",
			 json_number(loop_quantile(s->tick_100ns, 0.999, 100)), "max",
			 json_number(s->tick_max_ns));
}

static uint64_t ticks_with(const struct incise_loop_stats *s, enum incise_tick_flag flag)
{
	return s->flagged[__builtin_ctz(flag)];
}

static json_t *counts_json(const struct incise_realtime_counts *counts)
{
	return json_pack("{sI sI sI sI}", "minor_faults",
			 (json_int_t)counts->minor_faults, "major_faults",
			 (json_int_t)counts->major_faults, "voluntary_switches",
			 (json_int_t)counts->voluntary, "involuntary_switches",
			 (json_int_t)counts->involuntary);
}

void haptic_report_json(const struct haptic *haptic)
{
	struct incise_stepper *stepper = incise_rig_stepper(haptic->rig);
	const struct incise_loop_stats *s = haptic->stats;
	bool real = is_real(haptic);
	json_t *stages = json_array();

	for (int i = 0; incise_plan_stage(haptic->plan, i); i++)
		json_array_append_new(stages,
				      json_string(incise_plan_stage(haptic->plan, i)));
	json_print(json_pack(
		"{sI sI sI sf so so sI sI sI sI so sf so so ss so so so}", "ticks",
		(json_int_t)s->ticks, "skipped", (json_int_t)s->skipped, "overruns",
		(json_int_t)s->overruns, "rate_hz", haptic->loop.rate_hz, "lateness_us",
		real ? loop_lateness_json(s) : json_null(), "tick_ns",
		real ? cost_json(s) : json_null(), "contact",
		(json_int_t)ticks_with(s, INCISE_TICK_CONTACT), "extrapolated",
		(json_int_t)ticks_with(s, INCISE_TICK_EXTRAPOLATED), "stale",
		(json_int_t)ticks_with(s, INCISE_TICK_STALE), "limited",
		(json_int_t)s->limited, "flags", loop_flags_json(s->flagged),
		"force_max_N", s->force_max_N, "rendered_rms_error_N",
		json_number(render_error(haptic)), "actuator",
		stepper ? stepper_counters_json(stepper) : json_null(), "scheduling",
		haptic->scheduling, "thread", counts_json(&haptic->counts), "stages",
		stages, "stopped_by",
		cli_stop ? json_string(strsignal(cli_stop)) : json_null()));
}

void haptic_report_text(const struct haptic *haptic)
{
	struct incise_stepper *stepper = incise_rig_stepper(haptic->rig);
	const struct incise_loop_stats *s = haptic->stats;
	double rms_N = render_error(haptic);
	char a[32], b[32];

	printf("%llu ticks at %g Hz, %llu skipped in %llu overruns (%s)\nstages    ",
	       (unsigned long long)s->ticks, haptic->loop.rate_hz,
	       (unsigned long long)s->skipped, (unsigned long long)s->overruns,
	       haptic->scheduling);
	for (int i = 0; incise_plan_stage(haptic->plan, i); i++)
		printf(" %s", incise_plan_stage(haptic->plan, i));
	putchar('\n');
	/* In simulated time a tick takes none and is never late. */
	if (is_real(haptic)) {
		loop_lateness_line(s);
		printf("tick       median %s, 99.9 %% %s, max %.1f us\n",
		       loop_below(a, sizeof(a), loop_quantile(s->tick_100ns, 0.5, 0.1)),
		       loop_below(b, sizeof(b), loop_quantile(s->tick_100ns, 0.999, 0.1)),
		       s->tick_max_ns * 1e-3);
		printf("thread     %llu page faults, %llu times another had its CPU\n",
		       (unsigned long long)(haptic->counts.minor_faults +
					    haptic->counts.major_faults),
		       (unsigned long long)haptic->counts.involuntary);
	}
	printf("force      largest %.3f N", s->force_max_N);
	if (!isnan(rms_N))
		printf(", actuator off by %.4f N rms", rms_N);
	printf("\nticks      %llu in contact, %llu outside the model's support, %llu without a "
	       "fresh pose, %llu limited\n",
	       (unsigned long long)ticks_with(s, INCISE_TICK_CONTACT),
	       (unsigned long long)ticks_with(s, INCISE_TICK_EXTRAPOLATED),
	       (unsigned long long)ticks_with(s, INCISE_TICK_STALE),
	       (unsigned long long)s->limited);
	printf("held       %llu at the largest force, %llu at the largest slew, %llu at the end "
	       "of the travel, %llu by the guard, %llu starting or fading\n",
	       (unsigned long long)ticks_with(s, INCISE_TICK_CLAMPED),
	       (unsigned long long)ticks_with(s, INCISE_TICK_SLEWED),
	       (unsigned long long)ticks_with(s, INCISE_TICK_TRAVEL),
	       (unsigned long long)ticks_with(s, INCISE_TICK_GUARDED),
	       (unsigned long long)ticks_with(s, INCISE_TICK_STARTING));
	if (stepper)
		stepper_counters_line(stepper);
}
