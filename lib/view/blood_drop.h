/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Drops of blood: they hang at the wound and grow, run when their weight overcomes what
 * holds their edge, leave a film behind, and merge.
 *
 *      ╷╷╷  film, Landau and Levich: h = 0.94 lc (mu v / gamma)^(2/3)
 *      ╷╷╷
 *     ╭───╮   weight along the surface   rho g V s         s: sine of the slope
 *     │   │   held at the edge           gamma dcos 2 r    Furmidge; less on wet skin
 *     ╰───╯   viscous drag               C mu v 2 r        Kim, Lee and Kang 2002
 *       ▼
 *
 * A drop of volume V is a cap with a contact angle of 50°: V = 0.79 r³. Weight grows with
 * r³, what holds it with r: so each slope has a volume below which drops are pinned, some
 * µl. Above it the speed is what is left of the weight over the drag. Blood gets stiffer as
 * it clots. A drop that stays pinned sinks into the film below it.
 */
#ifndef INCISE_VIEW_BLOOD_DROP_H
#define INCISE_VIEW_BLOOD_DROP_H

#include <stdbool.h>
#include <stdint.h>
#include "blood_film.h"

#define DROPS_MAX 128
/* No drop grows beyond that by being fed or by merging, µl. */
#define DROP_MOST_UL 60.0

struct drop {
	int64_t units; /* 0: there is no drop */
	double px[2];
	double heading[2];	     /* unit, along and across downhill */
	double speed_mm_s;	     /* 0: pinned */
	struct ground_metric metric; /* of where it is */
	double age_s;
	double way_mm; /* since it left some film */
	int source;    /* that it hangs at and is fed by, or -1 */

	/*
	 * As it is drawn: the same, until it is seen to be another. Lengths of its shape
	 * are in radii of a round one: before, behind, to the sides of its axis.
	 */
	double drawn_px[2], drawn_mm, axis_px[2], before, behind, beside;
};

struct drops {
	struct film *film;
	uint32_t key;	  /* of what looks random */
	double viscosity; /* mN s/mm² */
	struct drop drop[DROPS_MAX];
};

void drops_init(struct drops *drops, struct film *film,
		const struct incise_scene_picture *picture, uint32_t key);

/*
 * A new one, hanging at a source; its index, or -1 when there are DROPS_MAX or there is no
 * surface. along_px: of the cut, of any length. units > 0.
 */
int drops_new(struct drops *drops, const double px[2], const double along_px[2],
	      int source, int64_t units);

/* 10 ms. */
void drops_step(struct drops *drops);

double drop_radius_mm(int64_t units);
int64_t drops_units(const struct drops *drops);
int drops_count(const struct drops *drops);

#endif
