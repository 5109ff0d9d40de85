/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Texture of a cut: the saw-tooth of Song et al. (2006), figure 2a, "a repeated process from elastic
 * deformation to abrupt fracturing", and the variation from cut to cut, learned from recordings at full
 * rate. A model's force is the mean; a texture multiplies it where the blade cuts:
 *
 *   F = F_model · (1 + τ(s)) · factor(cut)
 *
 * with s the way of the cut's front through new tissue. A texture is saved beside its model, MODEL.fis.tex
 * (incise-tex(5)), with a checksum of the parameters of its model.
 */
#ifndef INCISE_TEXTURE_H
#define INCISE_TEXTURE_H

#include <stddef.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>
#include <incise/model.h>

INCISE_BEGIN_DECLS

struct incise_texture;

/** Octaves of a spectrum. */
#define INCISE_TEXTURE_OCTAVES 4
/** Deciles of drops. */
#define INCISE_TEXTURE_DECILES 9

/** Points of a tape. */
#define INCISE_TEXTURE_TAPE 8192
/** Bytes of a unit's name. */
#define INCISE_TEXTURE_UNIT 16

/** Cuts by the metrics of their texture. */
struct incise_texture_look {
	double rate; /**< events per unit of the way */
	double rms;  /**< of the force's deviation from the model, relative to its mean */
	/** Deciles 0.1 … 0.9 of the drops of the events, relative to the force before. */
	double drop[INCISE_TEXTURE_DECILES];
	/** Power of each octave in dB; the first ends at up_to_cycles, each next one is below. */
	double octave[INCISE_TEXTURE_OCTAVES];
};

/** Numbers of a texture; lengths in the unit of the way that it was learned on, mm for scenes. */
struct incise_texture_info {
	char unit[INCISE_TEXTURE_UNIT]; /**< of the way: "mm", "deg" … */
	uint64_t seed;			/**< of its learning */
	double most;			/**< largest |τ|, 0 … 0.9 */
	double variation;     /**< sd of the logarithm of a cut's factor, ≥ 0 */
	double up_to_cycles;  /**< per unit of the way: half of the recordings' rate */
	int n_cuts, n_events; /**< that it was learned from */
	double length;	      /**< of their way, all together */
	double error
		[2]; /**< cross-validated distance of spectra in dB: without, with texture */
	/** The same cuts, as recorded, and rendered by a texture of other cuts. */
	struct incise_texture_look recorded, rendered;
};

/**
 * Read a .tex file. Every number is validated, and an error names file and line.
 *
 * @param path  file, or "-" for standard input
 * @param model its model; NULL: it may be of any
 * @return texture, to be freed with incise_texture_free(); NULL with errno of incise_infile_open() or
 *         incise_infile_line(), EINVAL (malformed), ESTALE (made for other parameters of the model),
 *         ENOMEM
 */
INCISE_API struct incise_texture *incise_texture_load(const char *path,
						      const struct incise_model *model,
						      struct incise_error *err);

/**
 * Write it with 17 significant digits, completely or not at all.
 *
 * @return 0, or a negative errno of incise_outfile_open() and incise_outfile_commit()
 */
INCISE_API int incise_texture_save(const struct incise_texture *texture, const char *path,
				   struct incise_error *err);

/** NULL is accepted. */
INCISE_API void incise_texture_free(struct incise_texture *texture);

/** Its numbers; owned by the texture. */
INCISE_API const struct incise_texture_info *incise_texture_info(
	const struct incise_texture *texture);

/**
 * The tape that ticks read: τ at multiples of a step, from which each cut starts at another place. It begins
 * again at its end.
 *
 * @param seed of a scene: tissue.seed
 * @return the step, in the unit of the way
 */
INCISE_API double incise_texture_tape(const struct incise_texture *texture, uint64_t seed,
				      double tau[INCISE_TEXTURE_TAPE]);

INCISE_END_DECLS
#endif
