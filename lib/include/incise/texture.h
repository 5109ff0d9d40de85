/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Texture of a cut: the saw-tooth of Song et al. (2006), figure 2a, "a repeated process from elastic
 * deformation to abrupt fracturing", and the variation from cut to cut, learned from recordings at full
 * rate. A model gives the mean force; a texture multiplies it:
 *
 *   F = F_model(inputs) · (1 + τ(s)) · factor(cut)
 *
 * with s the way of the front through new tissue. A texture is saved beside its model, MODEL.fis.tex
 *.
 */
#ifndef INCISE_TEXTURE_H
#define INCISE_TEXTURE_H

#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

struct incise_texture;

/** Numbers of a texture; lengths in the unit of the way that it was learned on, mm for scenes. */
struct incise_texture_info {
	const char *unit; /**< of the way: "mm", "deg" …; valid as long as the texture */
	double most;	  /**< largest |τ|, 0 … 0.9 */
	double rate;	  /**< events per unit of the way, recorded */
	double rms;	  /**< of τ */
	double variation;     /**< sd of the logarithm of a cut's factor, ≥ 0 */
	double up_to_cycles;  /**< per unit of the way: half of the recordings' rate */
	int n_cuts, n_events; /**< that it was learned from */
	double length;	      /**< of their way, all together */
};

/** Read a .tex file. NULL with errno of incise_infile_open(), EINVAL (malformed), ENOMEM. */
INCISE_API struct incise_texture *incise_texture_load(const char *path,
						      struct incise_error *err);

/** Write it, completely or not at all. 0, or a negative errno of incise_outfile_open(). */
INCISE_API int incise_texture_save(const struct incise_texture *texture, const char *path,
				   struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_texture_free(struct incise_texture *texture);

INCISE_API void incise_texture_info(const struct incise_texture *texture,
				    struct incise_texture_info *info);

INCISE_END_DECLS
#endif
