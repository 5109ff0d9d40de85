/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A scene: surface, tissue, device, limits and rate. It compiles to a plan; see incise/plan.h.
 *
 * A .scene file (libconfig); incise-scene(5) has every key:
 *
 *     rate_hz = 1000.0;
 *     model = "liver.fis";          # a model's force; path relative to the scene's folder
 *     arithmetic = "fixed";         # or "double"
 *     surface = { kind = "capsule"; from_mm = [0.0, 0.0, -55.0];
 *                 to_mm = [120.0, 0.0, -55.0]; radius_mm = 55.0; };   # or the rig's plane
 *     tissue  = { plane_N_mm = 0.1; damping_N_s_mm = 0.0005; };       # Bhasin et al. (2005)
 *     effects = { average_ticks = 8; };
 *     device  = { mass_kg = 0.05; damping_N_s_mm = 0.01; };
 *     limits  = { force_N = 4.0; slew_N_s = 400.0; pose_age_ms = 50.0; };
 */
#ifndef INCISE_SCENE_H
#define INCISE_SCENE_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/settings.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

struct incise_scene;

/**
 * Read a scene with its model and its surface.
 *
 * @param path  .scene file
 * @param model path of a model that replaces all of the scene's, or NULL
 * @return scene, to be freed with incise_scene_free(); NULL with errno of
 *         incise_infile_open(), EINVAL (syntax, unknown key, value out of range; the error
 *         names file, line and accepted range), or of incise_model_load(),
 *         incise_fixed_load(), incise_texture_load(), incise_surface_load_mesh().
 */
INCISE_API struct incise_scene *incise_scene_load(const char *path, const char *model,
						  struct incise_error *err);

/** Set the arithmetic: "fixed" or "double". @return 0, -EINVAL. */
INCISE_API int incise_scene_set_arithmetic(struct incise_scene *scene, const char *name,
					   struct incise_error *err);

/**
 * Set the size of the texture for the image.
 *
 * @param texture_px 256, 512, 1024, 2048 or 4096
 * @return 0, -EINVAL
 */
INCISE_API int incise_scene_set_texture(struct incise_scene *scene, int texture_px);

/**
 * Leave out the texture of the cuts, model.texture, and their variation: plans render the model's mean force. Call it
 * before a plan is made of the scene, for plans read its texture.
 */
INCISE_API void incise_scene_leave_texture_out(struct incise_scene *scene);

/** Why the texture that the scene's file names is left out; NULL: it is not, or the file names none. */
INCISE_API const char *incise_scene_texture_left_out(const struct incise_scene *scene);

/**
 * Keep every stage in the plan, with neutral parameters for those that the scene does not
 * need: to measure how much pruning saves. The forces are bit-exact.
 */
INCISE_API void incise_scene_set_full(struct incise_scene *scene, bool full);

/** NULL is accepted. */
INCISE_API void incise_scene_free(struct incise_scene *scene);

/**
 * Files of the scene: its own, its models, the mesh or heights of its surface. @return path of
 * file @i, from 0, valid as long as the scene; NULL: no more files.
 */
INCISE_API const char *incise_scene_file(const struct incise_scene *scene, int i);

/** Ticks per second of the scene. */
INCISE_API double incise_scene_rate_hz(const struct incise_scene *scene);

/** The scene's group `limits`. */
struct incise_scene_limits {
	double force_N;	    /**< largest force */
	double slew_N_s;    /**< largest change per second */
	double pose_age_ms; /**< without a younger pose the force ramps to 0 … */
	double fade_ms;	    /**< … within this time … */
	double ramp_ms;	    /**< … and ramps up again within this */
	double start_N;	    /**< no force until the tissue force is at most this */
};

/** Distance from the blade's tip to the other end of the scalpel, mm. */
INCISE_API double incise_scene_handle_mm(const struct incise_scene *scene);

/** The look of the tissue from above. */
enum incise_skin {
	INCISE_SKIN_PLAIN, /**< one colour */
	INCISE_SKIN_NECK,  /**< pores, creases, veins */
	INCISE_SKIN_LIVER,
};

/** The scene's group `picture`; see incise/view.h. */
struct incise_scene_picture {
	bool wound;    /**< cuts are drawn */
	bool bleeding; /**< they bleed */
	enum incise_skin skin;
	bool larynx;		/**< a larynx is visible; the group membrane renders it */
	int texture_px;		/**< side of the texture: 256, 512 … 4096 */
	double gravity[3];	/**< unit vector in which blood flows, tracker's frame */
	double blood_ul_s_mm2;	/**< per mm of length and mm of depth of a fresh cut */
	double viscosity_mPa_s; /**< of blood */
	int seed;
};

/** Get the group `picture` of the scene, with defaults filled in. */
INCISE_API void incise_scene_picture(const struct incise_scene *scene,
				     struct incise_scene_picture *picture);

/** The scene's group `tool`: the scalpel in its own frame, which poses rotate. */
struct incise_scene_scalpel {
	double axis[3];	  /**< unit, from the tip to the handle's end */
	double side[3];	  /**< unit, normal of the flat side of blade and handle */
	double handle_mm; /**< distance of the handle's end from the tip */
	double handle_width_mm, handle_thickness_mm; /**< of the handle's flat end */
	double tube_mm;				     /**< diameter of the tube */
};

/** Get the group `tool` of the scene, with defaults filled in. */
INCISE_API void incise_scene_scalpel(const struct incise_scene *scene,
				     struct incise_scene_scalpel *scalpel);

/** The scene's group `membrane`: a membrane over an airway, the target of a tube. */
struct incise_scene_membrane {
	double point_mm[3]; /**< its centre */
	double normal[3];   /**< unit, out of the tissue */
	double radius_mm;
	double thickness_mm; /**< depression at which it opens; 0: the scene has none */
	double puncture_N;   /**< force at which it opens; rises linearly up to there */
	double back_wall_mm; /**< distance of the airway's opposite wall */
};

/** Get the group `membrane` of the scene. @return whether the scene has it */
INCISE_API bool incise_scene_membrane(const struct incise_scene *scene,
				      struct incise_scene_membrane *membrane);

/** The criteria of a session that a scene can have, in its group `criteria`. */
enum incise_criterion {
	/** length of the longest incision, from end to end, mm */
	INCISE_CRITERION_CUT_LENGTH,
	INCISE_CRITERION_CUT_DEPTH,  /**< its largest depth, mm */
	INCISE_CRITERION_OFF_TARGET, /**< its distance from the membrane's axis, mm */
	INCISE_CRITERION_INCISIONS,  /**< number of incisions */
	INCISE_CRITERION_MEMBRANE,   /**< 1: a tool went through it; 0: no tool */
	INCISE_CRITERION_INSERTION,  /**< depth of the tube at the end, mm */
	INCISE_CRITERION_BACK_WALL,  /**< 1: touched; 0: not touched */
	INCISE_CRITERION_FORCE,	     /**< largest force, N */
	INCISE_CRITERION_TIME, /**< from first contact until the tube is in place, s */
};
#define INCISE_CRITERIA 9 /**< number of criteria */

/** Values that meet a criterion. */
struct incise_scene_criterion {
	bool asked;	 /**< the scene has it; otherwise the rest is 0 */
	double min, max; /**< limits, included */
};

/** Key of a criterion in a scene: "cut_length_mm", … NULL: no such criterion. */
INCISE_API const char *incise_criterion_name(int criterion);

/** Get the group `criteria` of the scene, by enum incise_criterion. */
INCISE_API void incise_scene_criteria(
	const struct incise_scene *scene,
	struct incise_scene_criterion criteria[INCISE_CRITERIA]);

/**
 * Compute a checksum over the current bytes of all files of a scene, in the order of
 * incise_scene_file().
 *
 * @param crc32c CRC with Castagnoli's polynomial
 * @return 0, or a negative errno of incise_infile_read()
 */
INCISE_API int incise_scene_checksum(const struct incise_scene *scene, uint32_t *crc32c,
				     struct incise_error *err);

/** Get the group `limits` of the scene, with defaults filled in. */
INCISE_API void incise_scene_limits(const struct incise_scene *scene,
				    struct incise_scene_limits *limits);

/** Whether a scene may have this key at its top level. */
INCISE_API bool incise_scene_has_key(const char *key);

/**
 * List the keys of a scene: the given ones, and the defaults of the others.
 *
 * @param path as for incise_scene_load()
 * @return 0; the value of @found; a negative errno of incise_scene_load()
 */
INCISE_API int incise_scene_keys(const char *path, incise_key_found *found, void *context,
				 struct incise_error *err);

INCISE_END_DECLS
#endif
