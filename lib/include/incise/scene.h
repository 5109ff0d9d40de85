/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * A scene says what is felt: the surface, the tissue, limits and rate. It compiles to a
 * plan; see incise/plan.h.
 *
 * A .scene file (libconfig); incise-scene(5) has every key:
 *
 *     rate_hz = 1000.0;
 *     model = "liver.fis";          # paper 1's force; path relative to the scene's folder
 *     arithmetic = "fixed";         # or "double"
 *     surface = { kind = "capsule"; from_mm = [0.0, 0.0, -55.0];
 *                 to_mm = [120.0, 0.0, -55.0]; radius_mm = 55.0; };   # or the rig's plane
 *     tissue  = { plane_N_mm = 0.1; damping_N_s_mm = 0.0005; };       # paper 2's constants
 *     effects = { average_ticks = 8; };
 *     device  = { mass_kg = 0.05; damping_N_s_mm = 0.01; };
 *     limits  = { force_N = 4.0; slew_N_s = 400.0; pose_age_ms = 50.0; };
 */
#ifndef INCISE_SCENE_H
#define INCISE_SCENE_H

#include <stdbool.h>
#include <stdint.h>
#include <incise/error.h>
#include <incise/export.h>

INCISE_BEGIN_DECLS

struct incise_scene;

/**
 * Read a scene, and the model and the surface it names.
 *
 * @param path  .scene file
 * @param model path of a model that takes the place of the scene's, or NULL
 * @return scene, to be freed with incise_scene_free(); NULL with errno of incise_infile_open(),
 *         EINVAL (syntax, unknown key, value out of range: file, line and accepted range
 *         are named), or of incise_model_load(), incise_fixed_load(),
 *         incise_surface_load_mesh().
 */
INCISE_API struct incise_scene *incise_scene_load(const char *path, const char *model,
						  struct incise_error *err);

/** Use another arithmetic than the file's: "fixed" or "double". @return 0, -EINVAL. */
INCISE_API int incise_scene_set_arithmetic(struct incise_scene *scene, const char *name,
					   struct incise_error *err);

/**
 * Use a texture of another size than the file's for the picture.
 *
 * @param texture_px 256, 512, 1024, 2048 or 4096
 * @return 0, -EINVAL
 */
INCISE_API int incise_scene_set_texture(struct incise_scene *scene, int texture_px);

/**
 * Keep every stage in the plan, with what the scene does not ask for set neutral: to
 * measure what leaving out saves. The forces are the same, to the bit.
 */
INCISE_API void incise_scene_set_full(struct incise_scene *scene, bool full);

/** NULL is accepted. */
INCISE_API void incise_scene_free(struct incise_scene *scene);

/**
 * A file that the scene was read from, by its number from 0 on: the scene's own, its model,
 * the mesh or heights of its surface. @return path, valid as long as the scene; NULL: no more.
 */
INCISE_API const char *incise_scene_file(const struct incise_scene *scene, int i);

/** Ticks per second that it asks for. */
INCISE_API double incise_scene_rate_hz(const struct incise_scene *scene);

/** The scene's group `limits`. */
struct incise_scene_limits {
	double force_N;	    /**< largest force */
	double slew_N_s;    /**< largest change of it in a second */
	double pose_age_ms; /**< without a younger pose the force fades … */
	double fade_ms;	    /**< … in this time … */
	double ramp_ms;	    /**< … and comes back in this */
	double start_N;	    /**< no force before one as small as this is asked for */
};

/** From the blade's tip to the other end of the scalpel, mm. */
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
	bool larynx;	   /**< it shows through; felt is the group membrane */
	int texture_px;	   /**< side of the texture: 256, 512 … 4096 */
	double gravity[3]; /**< unit vector: where blood runs, in the tracker's frame */
	double blood_ul_s_mm2;	/**< for each mm of length and of depth of a fresh cut */
	double viscosity_mPa_s; /**< of blood */
	int seed;
};

/** Get the group `picture` of the scene, with defaults filled in. */
INCISE_API void incise_scene_picture(const struct incise_scene *scene,
				     struct incise_scene_picture *picture);

/** The scene's group `tool`: the scalpel, in its own frame, which poses turn. */
struct incise_scene_scalpel {
	double axis[3];	  /**< unit, from the tip to the handle's end */
	double side[3];	  /**< unit, normal of the flat side of blade and handle */
	double handle_mm; /**< the handle's end from the tip */
	double handle_width_mm, handle_thickness_mm; /**< of its flat end */
	double tube_mm;				     /**< diameter of the tube */
};

/** Get the group `tool` of the scene, with defaults filled in. */
INCISE_API void incise_scene_scalpel(const struct incise_scene *scene,
				     struct incise_scene_scalpel *scalpel);

/** The scene's group `membrane`: over an airway, and the target of a tube. */
struct incise_scene_membrane {
	double point_mm[3]; /**< its middle */
	double normal[3];   /**< unit, out of the tissue */
	double radius_mm;
	double thickness_mm; /**< it yields after so much; 0: the scene has none … */
	double puncture_N;   /**< … with this force, to which it rises evenly */
	double back_wall_mm; /**< the airway's other side, from the membrane */
};

/** Get the group `membrane` of the scene. @return whether it has one */
INCISE_API bool incise_scene_membrane(const struct incise_scene *scene,
				      struct incise_scene_membrane *membrane);

/** The criteria of a session that a scene can have, in its group `criteria`. */
enum incise_criterion {
	INCISE_CRITERION_CUT_LENGTH, /**< of the longest incision, from end to end, mm */
	INCISE_CRITERION_CUT_DEPTH,  /**< largest one of it, mm */
	INCISE_CRITERION_OFF_TARGET, /**< of it from the membrane's axis, mm */
	INCISE_CRITERION_INCISIONS,  /**< their number */
	INCISE_CRITERION_MEMBRANE,   /**< 1: a tool went through it; 0: none did */
	INCISE_CRITERION_INSERTION,  /**< depth of the tube at the end, mm */
	INCISE_CRITERION_BACK_WALL,  /**< 1: it was touched; 0: it was not */
	INCISE_CRITERION_FORCE,	     /**< largest one, N */
	INCISE_CRITERION_TIME, /**< from the first contact until the tube is in place, s */
};
#define INCISE_CRITERIA 9 /**< how many there are */

/** Values of a criterion that meet it. */
struct incise_scene_criterion {
	bool asked;	 /**< the scene has it; else the rest is 0 */
	double min, max; /**< both meet it */
};

/** Its key in a scene: "cut_length_mm", … NULL: there is none of this number. */
INCISE_API const char *incise_criterion_name(int criterion);

/** Get the group `criteria` of the scene, by enum incise_criterion. */
INCISE_API void incise_scene_criteria(
	const struct incise_scene *scene,
	struct incise_scene_criterion criteria[INCISE_CRITERIA]);

/**
 * A checksum over the bytes of all files of a scene, in the order of incise_scene_file(), as they
 * are now.
 *
 * @param crc32c of Castagnoli's polynomial
 * @return 0, or a negative errno of incise_infile_read()
 */
INCISE_API int incise_scene_checksum(const struct incise_scene *scene, uint32_t *crc32c,
				     struct incise_error *err);

/** Get the group `limits` of the scene, with defaults filled in. */
INCISE_API void incise_scene_limits(const struct incise_scene *scene,
				    struct incise_scene_limits *limits);

INCISE_END_DECLS
#endif
