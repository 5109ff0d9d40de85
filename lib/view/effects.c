// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What ticks do to the texture; see effects.h.
 */
#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include "blood.h"
#include "blood_film.h"
#include "effects.h"
#include "wound.h"

struct incise_effects {
	struct incise_canvas *canvas;
	struct wound *wound; /* or NULL */
	struct blood *blood; /* or NULL */
	int wound_layer, blood_layer;
	bool began;
	int64_t step_ns; /* time of the last step */
	uint64_t steps_lost;
};

static int add_layer(struct incise_effects *effects, int *layer, struct incise_error *err)
{
	*layer = incise_canvas_add_layer(effects->canvas);
	if (*layer >= 0)
		return 0;
	return incise_error_set(err, -*layer, "view: no layer for wound or blood");
}

/* What the scene asks for. */
static int add(struct incise_effects *effects, const struct incise_scene_picture *picture,
	       const struct incise_chart *chart, struct incise_error *err)
{
	int rc;

	if (!picture->wound)
		return 0;
	effects->wound = wound_new(chart, err);
	if (!effects->wound)
		return -ENOMEM;
	rc = add_layer(effects, &effects->wound_layer, err);
	if (rc || !picture->bleeding)
		return rc;
	effects->blood = blood_new(chart, picture, err);
	if (!effects->blood)
		return -ENOMEM;
	return add_layer(effects, &effects->blood_layer, err);
}

struct incise_effects *incise_effects_new(const struct incise_scene_picture *picture,
					  const struct incise_chart *chart,
					  struct incise_canvas *canvas,
					  struct incise_error *err)
{
	struct incise_effects *effects;

	if (chart->size != incise_canvas_size(canvas)) {
		incise_error_set(err, EINVAL,
				 "view: a chart of %d texels on a canvas of %d",
				 chart->size, incise_canvas_size(canvas));
		return NULL;
	}
	effects = calloc(1, sizeof(*effects));
	if (!effects) {
		incise_error_set(err, ENOMEM, "view: no memory");
		return NULL;
	}
	effects->canvas = canvas;
	if (add(effects, picture, chart, err)) {
		incise_effects_free(effects);
		return NULL;
	}
	return effects;
}

void incise_effects_free(struct incise_effects *effects)
{
	if (!effects)
		return;
	wound_free(effects->wound);
	blood_free(effects->blood);
	free(effects);
}

static void step(struct incise_effects *effects)
{
	double px[2], depth_mm;

	wound_step(effects->wound);
	if (!effects->blood)
		return;
	if (wound_inserted(effects->wound, px, &depth_mm))
		blood_reopen(effects->blood, px, depth_mm);
	blood_step(effects->blood);
}

/* Steps up to a tick's time, with what was there before it. */
static void step_until(struct incise_effects *effects, int64_t t_ns)
{
	uint64_t steps, done;

	/* Of a clock that was set back, or of a new run: time goes on from there. */
	if (!effects->began || t_ns < effects->step_ns) {
		if (!effects->began ||
		    (uint64_t)effects->step_ns - (uint64_t)t_ns > EFFECTS_STEP_NS)
			effects->step_ns = t_ns;
		effects->began = true;
		return;
	}
	steps = ((uint64_t)t_ns - (uint64_t)effects->step_ns) / EFFECTS_STEP_NS;
	/* Not beyond t_ns, so no overflow. */
	effects->step_ns =
		(int64_t)((uint64_t)effects->step_ns + steps * EFFECTS_STEP_NS);
	done = steps < EFFECTS_STEPS_MAX ? steps : EFFECTS_STEPS_MAX;
	effects->steps_lost += steps - done;
	for (uint64_t i = 0; i < done; i++)
		step(effects);
}

void incise_effects_tick(struct incise_effects *effects, const struct incise_tick *tick)
{
	struct wound_stroke stroke;

	if (!effects->wound)
		return;
	step_until(effects, tick->t_ns);
	if (wound_tick(effects->wound, tick, &stroke) && effects->blood)
		blood_stroke(effects->blood, &stroke);
}

void incise_effects_paint(struct incise_effects *effects)
{
	if (effects->wound)
		wound_paint(effects->wound, effects->canvas, effects->wound_layer);
	if (effects->blood)
		blood_paint(effects->blood, effects->canvas, effects->blood_layer);
}

void incise_effects_report(const struct incise_effects *effects,
			   struct incise_effects_report *report)
{
	struct blood_volumes volumes;

	*report = (struct incise_effects_report){.steps_lost = effects->steps_lost};
	if (!effects->wound)
		return;
	report->cut_mm = wound_cut_mm(effects->wound);
	report->stamps = wound_stamps(effects->wound);
	if (!effects->blood)
		return;
	blood_volumes(effects->blood, &volumes);
	report->blood_ul_emitted = (double)volumes.emitted * BLOOD_UNIT_UL;
	report->blood_ul_drops = (double)volumes.drops * BLOOD_UNIT_UL;
	report->blood_ul_trails = (double)volumes.films * BLOOD_UNIT_UL;
	report->blood_ul_off = (double)volumes.off * BLOOD_UNIT_UL;
	report->drops = volumes.n_drops;
}

size_t incise_effects_memory(const struct incise_effects *effects)
{
	return sizeof(*effects) + (effects->wound ? wound_memory(effects->wound) : 0) +
	       (effects->blood ? blood_memory(effects->blood) : 0);
}
