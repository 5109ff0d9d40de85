// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * What a drop looks like; see blood_drop_shape.h.
 */
#include <math.h>
#include "blood_drop_shape.h"

/* A change that is seen, in mm. */
#define SEEN_MM 0.04
#define SEEN 0.03
/* 1 / sqrt(1 - FILM_ROUGH), rounded up. */
#define ROUGHEST 1.2
/* The part by which a shape changes when it is shown. */
#define TURNS_INTO 0.22

bool drop_box(const struct film *film, const struct drop *drop, struct drop_box *box)
{
	struct ground_metric *m = &box->metric;
	double u, v, length, along, beside, half_u, half_v, half_x;

	if (!(drop->drawn_mm > 0) || !ground_metric(film->chart, drop->drawn_px, m))
		return false;
	u = m->a * drop->axis_px[0] + m->b * drop->axis_px[1];
	v = m->c * drop->axis_px[1];
	length = sqrt(u * u + v * v);
	box->axis[0] = length > 0 ? u / length : 0;
	box->axis[1] = length > 0 ? v / length : 1;
	/* Of the ellipse that holds both halves, at its roughest. */
	along = drop->drawn_mm * fmax(drop->before, drop->behind) * ROUGHEST;
	beside = drop->drawn_mm * drop->beside * ROUGHEST;
	half_u = hypot(along * box->axis[0], beside * box->axis[1]);
	half_v = hypot(along * box->axis[1], beside * box->axis[0]);
	half_x = (half_u + half_v * fabs(m->b) / m->c) / m->a;
	box->left = (int)floor(drop->drawn_px[0] - half_x);
	box->right = (int)floor(drop->drawn_px[0] + half_x);
	box->top = (int)floor(drop->drawn_px[1] - half_v / m->c);
	box->bottom = (int)floor(drop->drawn_px[1] + half_v / m->c);
	return true;
}

void drops_mark(struct drops *drops, const struct drop *drop)
{
	struct drop_box box;

	if (drop_box(drops->film, drop, &box))
		film_mark(drops->film, box.left, box.top, box.right, box.bottom);
}

static bool nearer(double *value, double to)
{
	if (fabs(*value - to) < SEEN)
		return false;
	*value += (to - *value) * TURNS_INTO;
	return true;
}

/*
 * What is drawn follows when it would be seen; always by the drops' own steps. A drop that
 * hangs lies along its cut; one that runs has a round head and is drawn out behind.
 */
void drops_show(struct drops *drops, struct drop *drop, const struct ground *ground)
{
	double radius = drop_radius_mm(drop->units);
	double moved = ground_length_mm(&ground->metric, drop->px[0] - drop->drawn_px[0],
					drop->px[1] - drop->drawn_px[1]);
	double fast = fmin(drop->speed_mm_s / 15, 1);
	struct drop is = *drop;
	bool other;

	if (drop->source < 0) {
		other = nearer(&is.before, 0.8);
		other = nearer(&is.behind, 0.9 + 1.6 * fast) || other;
		other = nearer(&is.beside, 0.9 - 0.25 * fast) || other;
		for (int i = 0; i < 2 && drop->speed_mm_s > 0; i++)
			is.axis_px[i] = drop->heading[0] * ground->down_px[i] +
					drop->heading[1] * ground->across_px[i];
	} else {
		other = false;
	}
	if (!other && fabs(radius - drop->drawn_mm) < SEEN_MM && moved < SEEN_MM)
		return;
	drops_mark(drops, drop);
	*drop = is;
	drop->drawn_mm = radius;
	drop->drawn_px[0] = drop->px[0];
	drop->drawn_px[1] = drop->px[1];
	drops_mark(drops, drop);
}

void drop_turn_round(struct drop *drop, const struct ground *ground)
{
	const struct ground_metric *m = &ground->metric;
	double u = m->a * drop->axis_px[0] + m->b * drop->axis_px[1];
	double v = m->c * drop->axis_px[1], length = sqrt(u * u + v * v);
	double a = m->a * ground->down_px[0] + m->b * ground->down_px[1];
	double b = m->c * ground->down_px[1], along, across;

	if (!(length > 0))
		return;
	along = fabs(u * a + v * b) / length;
	across = sqrt(fmax(1 - along * along, 0));
	drop->before = drop->behind =
		along * DROP_HANGS_ALONG + across * DROP_HANGS_ACROSS;
	drop->beside = along * DROP_HANGS_ACROSS + across * DROP_HANGS_ALONG;
	drop->axis_px[0] = ground->down_px[0];
	drop->axis_px[1] = ground->down_px[1];
}
