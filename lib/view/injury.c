// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The wound and the blood that follow from ticks; see injury.h.
 */
#include <errno.h>
#include <stdbool.h>
#include <stdlib.h>
#include "blood.h"
#include "blood_film.h"
#include "injury.h"
#include "wound.h"

struct incise_injury {
	struct incise_canvas *canvas;
	struct wound *wound;			  /* or NULL */
	struct blood *blood;			  /* or NULL */
	int skin_layer, blood_layer, flesh_layer; /* from below */
	bool began;
	int64_t step_ns; /* time of the last step */
	uint64_t steps_lost;
};

static int add_layer(struct incise_injury *injury, int *layer, struct incise_error *err)
{
	*layer = incise_canvas_add_layer(injury->canvas);
	if (*layer >= 0)
		return 0;
	return incise_error_set(err, -*layer, "view: no layer for wound or blood");
}

/* Add the parts that the scene requests. */
static int add_injury(struct incise_injury *injury,
		      const struct incise_scene_picture *picture,
		      const struct incise_scene_scalpel *scalpel,
		      struct incise_incision *incision, const struct uv_map *map,
		      struct incise_error *err)
{
	int rc;

	if (!picture->wound)
		return 0;
	injury->wound = wound_new(map, scalpel, incision, err);
	if (!injury->wound)
		return -ENOMEM;
	rc = add_layer(injury, &injury->skin_layer, err);
	if (!rc && picture->bleeding) {
		injury->blood = blood_new(map, picture, err);
		rc = injury->blood ? add_layer(injury, &injury->blood_layer, err)
				   : -ENOMEM;
	}
	return rc ? rc : add_layer(injury, &injury->flesh_layer, err);
}

struct incise_injury *incise_injury_new(const struct incise_scene_picture *picture,
					const struct incise_scene_scalpel *scalpel,
					struct incise_incision *incision,
					const struct uv_map *map,
					struct incise_canvas *canvas,
					struct incise_error *err)
{
	struct incise_injury *injury;

	if (map->size != incise_canvas_size(canvas))
		return INCISE_ERROR_NULL(err, EINVAL,
					 "view: a UV map of %d texels on a canvas of %d",
					 map->size, incise_canvas_size(canvas));
	injury = calloc(1, sizeof(*injury));
	if (!injury)
		return INCISE_ERROR_NULL(err, ENOMEM, "view: no memory");
	injury->canvas = canvas;
	if (add_injury(injury, picture, scalpel, incision, map, err)) {
		incise_injury_free(injury);
		return NULL;
	}
	return injury;
}

void incise_injury_free(struct incise_injury *injury)
{
	if (!injury)
		return;
	wound_free(injury->wound);
	blood_free(injury->blood);
	free(injury);
}

static void step_injury(struct incise_injury *injury)
{
	double px[2], depth_mm;

	wound_step(injury->wound);
	if (!injury->blood)
		return;
	if (wound_inserted(injury->wound, px, &depth_mm))
		blood_reopen(injury->blood, px, depth_mm);
	blood_step(injury->blood);
}

/* Steps up to a tick's time, with the state before it. */
static void step_until(struct incise_injury *injury, int64_t t_ns)
{
	uint64_t steps, done;

	/* At a clock that was set back, or a new run, time restarts there. */
	if (!injury->began || t_ns < injury->step_ns) {
		if (!injury->began ||
		    (uint64_t)injury->step_ns - (uint64_t)t_ns > INJURY_STEP_NS)
			injury->step_ns = t_ns;
		injury->began = true;
		return;
	}
	steps = ((uint64_t)t_ns - (uint64_t)injury->step_ns) / INJURY_STEP_NS;
	/* At most t_ns: no overflow. */
	injury->step_ns = (int64_t)((uint64_t)injury->step_ns + steps * INJURY_STEP_NS);
	done = steps < INJURY_STEPS_MAX ? steps : INJURY_STEPS_MAX;
	injury->steps_lost += steps - done;
	for (uint64_t i = 0; i < done; i++)
		step_injury(injury);
}

void incise_injury_tick(struct incise_injury *injury, const struct incise_tick *tick)
{
	struct wound_stroke stroke;

	if (!injury->wound)
		return;
	step_until(injury, tick->t_ns);
	if (wound_tick(injury->wound, tick, &stroke) && injury->blood)
		blood_stroke(injury->blood, &stroke);
}

void incise_injury_paint(struct incise_injury *injury)
{
	if (injury->wound)
		wound_paint(injury->wound, injury->canvas, injury->skin_layer,
			    injury->flesh_layer);
	if (injury->blood)
		blood_paint(injury->blood, injury->canvas, injury->blood_layer);
}

void incise_injury_report(const struct incise_injury *injury,
			  struct incise_view_report *report)
{
	struct blood_volumes volumes;

	if (!injury->wound)
		return;
	report->cut_mm = wound_cut_mm(injury->wound);
	report->stamps = wound_stamps(injury->wound);
	if (!injury->blood)
		return;
	blood_volumes(injury->blood, &volumes);
	report->blood_ul_emitted = (double)volumes.emitted * BLOOD_UNIT_UL;
	report->blood_ul_drops = (double)volumes.drops * BLOOD_UNIT_UL;
	report->blood_ul_trails = (double)volumes.films * BLOOD_UNIT_UL;
	report->blood_ul_off = (double)volumes.off * BLOOD_UNIT_UL;
	report->drops = volumes.n_drops;
}

uint64_t incise_injury_steps_lost(const struct incise_injury *injury)
{
	return injury->steps_lost;
}
