/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * The injury in the texture: a wound along the blade's way, and blood that runs from it.
 *
 *     ticks ─▶ [wound] ─ fresh cuts ─▶ [blood]      state: a function of the ticks alone
 *                 │                       │
 *              paint                    paint       pixels: a function of the state alone
 *                 └─▶ layers of a canvas ◀┘
 *
 * Time is the ticks'. Lips and blood move in steps of 10 ms of it, at any tick rate. So the same
 * ticks give the same texture to the bit, however often it is painted. A scene without `wound` has
 * no layer (and no blood), one without `bleeding` no blood.
 *
 * Ticks are not trusted: values that are not finite, or too far or fast for a hand, cut nothing.
 * One thread at a time.
 */
#ifndef INCISE_VIEW_INJURY_H
#define INCISE_VIEW_INJURY_H

#include <stdint.h>
#include <incise/error.h>
#include <incise/incision.h>
#include <incise/plan.h>
#include <incise/scene.h>
#include <incise/view.h>
#include "canvas.h"
#include "uv_map.h"

#define INJURY_STEP_NS 10000000 /* 10 ms */
/* After a gap in the ticks at most so many steps follow at once; the rest is skipped. */
#define INJURY_STEPS_MAX 100

struct incise_injury;

/*
 * map, canvas and incision must live longer. Map and canvas have the same size; layers are added to
 * the canvas. The incision, or NULL, is fed with the ticks.
 * Returns NULL with errno EINVAL, ENOMEM, ENOSPC.
 */
struct incise_injury *incise_injury_new(const struct incise_scene_picture *picture,
					const struct incise_scene_scalpel *scalpel,
					struct incise_incision *incision,
					const struct uv_map *map,
					struct incise_canvas *canvas,
					struct incise_error *err);

/* Each tick, in order. */
void incise_injury_tick(struct incise_injury *injury, const struct incise_tick *tick);

/* Update the canvas's layers; before incise_canvas_compose(). */
void incise_injury_paint(struct incise_injury *injury);

/* Set the fields of wound and blood, and leave the others. */
void incise_injury_report(const struct incise_injury *injury,
			  struct incise_view_report *report);

/* Steps of 10 ms that were skipped in long gaps. */
uint64_t incise_injury_steps_lost(const struct incise_injury *injury);

void incise_injury_free(struct incise_injury *injury);

#endif
