// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A pass over the cuts of some recordings; see export_pass.h.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include "export_pass.h"
#include "../read/recording.h"

char *incise_export_name(struct incise_recording *const *recordings, int at)
{
	const char *name = recordings[at]->name;
	int same = 1;
	char *text;

	for (int i = 0; i < at; i++)
		same += !strcmp(recordings[i]->name, name);
	/* '~' stands in no recording's own suffix of this kind. */
	if (same > 1 ? asprintf(&text, "%s~%d", name, same) < 0
		     : asprintf(&text, "%s", name) < 0)
		return NULL;
	for (char *c = text; *c; c++)
		if ((unsigned char)*c < ' ' || *c == 0x7f)
			*c = '_';
	return text;
}

int incise_export_cut_name(struct incise_export_pass *pass)
{
	char *text;
	int rc;

	if (asprintf(&text, "%s-%02d", pass->name, pass->number) < 0)
		return incise_error_set(pass->err, ENOMEM, "out of memory");
	rc = incise_table_name(pass->table, text);
	free(text);
	if (rc < 0)
		return incise_error_set(pass->err, -rc, "out of memory");
	return rc;
}

/* Welford's way: one pass, no cancellation. */
void incise_export_bin_add(struct incise_export_bin *bin,
			   const struct incise_cut_sample *sample, double t_s, int cut)
{
	double share = 1.0 / ++bin->n;
	double delta = sample->force_N - bin->force_N;

	bin->t_s += share * (t_s - bin->t_s);
	bin->depth_mm += share * (sample->depth_mm - bin->depth_mm);
	bin->velocity_mm_s += share * (sample->velocity_mm_s - bin->velocity_mm_s);
	bin->force_N += share * delta;
	bin->m2 += delta * (sample->force_N - bin->force_N);
	bin->clipped |= sample->clipped;
	if (bin->last != cut) {
		bin->last = cut;
		bin->cuts++;
	}
}

void incise_export_extent(struct incise_export_pass *pass,
			  const struct incise_cut_sample *sample)
{
	const struct incise_export_options *o = pass->options;
	struct incise_export_report *report = &pass->report;

	if (sample->clipped)
		return;
	if (!(o->depth_max_mm > 0))
		report->depth_max_mm = fmax(report->depth_max_mm, sample->depth_mm);
	if (!(o->velocity_max_mm_s > 0))
		report->velocity_max_mm_s =
			fmax(report->velocity_max_mm_s, sample->velocity_mm_s);
}

/* What was gathered of the cut before goes out before a new one starts. */
static int end_cut(struct incise_export_pass *pass,
		   const struct incise_export_visitor *visitor)
{
	return pass->number && visitor->end_cut ? visitor->end_cut(pass) : 0;
}

/* 0, or -EINTR where whoever watches wants it to end. */
static int tell(struct incise_export_pass *pass, uint64_t samples)
{
	const struct incise_export_options *o = pass->options;

	if (o->progress &&
	    o->progress(o->context, fmin(1, (double)(pass->samples + samples) /
						    fmax(1, pass->samples_all))))
		return incise_error_set(pass->err, EINTR, "interrupted");
	return 0;
}

/* Pass over the cuts of one recording. */
static int each_sample(struct incise_export_pass *pass,
		       struct incise_recording *recording,
		       const struct incise_export_visitor *visitor)
{
	const struct incise_calibration *calibration = pass->options->calibration;
	struct incise_cut_sample sample;
	struct incise_cuts cuts;
	int rc;

	rc = incise_cuts_open(&cuts, recording, pass->err);
	if (rc)
		return rc;
	if (calibration)
		incise_cuts_calibrate(&cuts, calibration);
	rc = incise_recording_need_zero(recording, &cuts.scale, pass->err);
	if (rc) {
		incise_cuts_close(&cuts);
		return rc;
	}
	pass->number = 0;
	while ((rc = incise_cuts_next(&cuts, &sample, pass->err)) > 0) {
		if (sample.cut != pass->number) {
			rc = end_cut(pass, visitor);
			if (rc)
				break;
			pass->number = sample.cut;
			pass->cut++;
		}
		rc = visitor->sample(pass, &sample, (sample.t_ns - cuts.first_ns) * 1e-9);
		if (!rc && (cuts.force_rows & 0xfff) == 0)
			rc = tell(pass, cuts.force_rows);
		if (rc)
			break;
	}
	if (!rc)
		rc = end_cut(pass, visitor);
	pass->samples += cuts.force_rows;
	pass->depth_deepest_mm = fmax(pass->depth_deepest_mm, cuts.depth_max_mm);
	incise_cuts_close(&cuts);
	return rc;
}

int incise_export_each(struct incise_export_pass *pass,
		       struct incise_recording *const *recordings, int n,
		       const struct incise_export_visitor *visitor)
{
	int rc = 0;

	pass->cut = 0;
	for (int i = 0; i < n && !rc; i++) {
		free(pass->name);
		pass->name = incise_export_name(recordings, i);
		rc = pass->name ? each_sample(pass, recordings[i], visitor)
				: incise_error_set(pass->err, ENOMEM, "out of memory");
	}
	return rc;
}
