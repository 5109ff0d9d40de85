// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * The shaders; see shaders.h. The shaders of the surface work as far as possible at the vertices,
 * a millimetre or two apart: light, half-way vector and up are rotated into the texture's frame
 * there, and the instrument's shadow is computed there.
 */
#include <epoxy/gl.h>
#include <errno.h>
#include <stdio.h>
#include "shaders.h"

#define HEAD "#version 330 core\n"

/*
 * Shadow: distance between the way from a place to the light and a piece of the instrument, a line
 * with a thickness; the farther away, the softer.
 */
static const char surface_vs[] = HEAD
	"layout(location = 0) in vec3 in_0;\n" /* place, mm */
	"layout(location = 1) in vec3 in_1;\n" /* normal */
	"layout(location = 2) in vec4 in_2;\n" /* tangent */
	"layout(location = 3) in vec2 in_3;\n" /* texels */
	"uniform mat4 clip;\n"
	"uniform vec3 camera, key, sky;\n"
	"uniform float texel;\n"
	"uniform int casters;\n"
	"uniform vec4 from[4], to[4];\n" /* mm; w: radius */
	"uniform vec4 dent;\n"		 /* where the instrument presses, mm; w: radius */
	"uniform float dent_mm;\n"	 /* depth there */
	"out vec2 uv;\n"
	"out vec4 light;\n" /* w: not in the shadow */
	"out vec3 half_way, up;\n"
	"float shade(vec3 p, vec4 a, vec4 b)\n"
	"{\n"
	"	vec3 d = b.xyz - a.xyz, w = p - a.xyz;\n"
	"	float dd = dot(d, d), dk = dot(d, key);\n"
	"	float s = clamp((dot(d, w) - dk * dot(key, w)) / max(dd - dk * dk, 1e-3), 0, 1);\n"
	"	vec3 q = a.xyz + s * d - p;\n"
	"	float t = max(dot(q, key), 0.0);\n"
	"	float off = length(q - t * key), soft = 1.2 + 0.14 * t;\n"
	"	float r = mix(a.w, b.w, s);\n"
	"	return smoothstep(r + soft, r - soft, off) / (1.0 + 0.012 * t);\n"
	"}\n"
	"void main()\n"
	"{\n"
	"	vec3 n = in_1, t = in_2.xyz, p = in_0, off = (p - dent.xyz) / dent.w;\n"
	"	float fall = 1.0 / (1.0 + dot(off, off));\n"
	"	p -= n * (dent_mm * fall * fall);\n"
	"	n = normalize(n - (4.0 * dent_mm / dent.w * fall * fall * fall) * off);\n"
	"	t -= dot(t, n) * n;\n"
	"	vec3 b = in_2.w * cross(n, t);\n"
	"	vec3 h = normalize(normalize(camera - p) + key);\n"
	"	float dark = 0.0;\n"
	"	for (int i = 0; i < casters; i++)\n"
	"		dark = max(dark, shade(p, from[i], to[i]));\n"
	"	light = vec4(dot(t, key), dot(b, key), dot(n, key), 1.0 - 0.8 * dark);\n"
	"	half_way = vec3(dot(t, h), dot(b, h), dot(n, h));\n"
	"	up = vec3(dot(t, sky), dot(b, sky), dot(n, sky));\n"
	"	uv = in_3 * texel;\n"
	"	gl_Position = clip * vec4(p, 1);\n"
	"}\n";

/*
 * Light penetrates the skin, red the farthest: it wraps round into the shade. The highlight is GGX
 * with a constant Fresnel term: skin is rough, wet surfaces are smooth.
 *
 * Only wet surfaces are deep red. The texture's alpha is the slope towards the lamp, see draw.c.
 *
 * A surgical drape lies round a neck and hides the border of its texture. Blood runs below it, and
 * soaks its edge.
 */
static const char surface_fs[] = HEAD
	"in vec2 uv;\n"
	"in vec4 light;\n"
	"in vec3 half_way, up;\n"
	"uniform sampler2D base;\n"
	"uniform vec2 way;\n"
	"uniform float cloth, moist;\n"
	"out vec4 colour;\n"
	"void main()\n"
	"{\n"
	"	vec2 in_from = min(uv, 1.0 - uv);\n"
	"	float edge = min(in_from.x, in_from.y) - cloth;\n"
	"	float skin = clamp(edge * 400.0, 0.0, 1.0);\n"
	"	vec4 c = texture(base, uv);\n"
	"	float wet = clamp(3.0 * c.r - 7.0 * c.g, 0.0, 1.0);\n"
	"	float s = c.a * (255.0 / 127.0) - 128.0 / 127.0;\n"
	"	vec3 n = vec3(way * s, 1.0 - 0.5 * s * s);\n"
	"	n.xy *= skin;\n"
	"	float below = clamp(edge * 60.0 + 0.55, 0.55, 1.0);\n"
	"	float soaked = wet * clamp(1.0 + edge * 40.0, 0.0, 1.0);\n"
	"	vec3 cloth_rgb = mix(vec3(0.045, 0.17, 0.18), vec3(0.075, 0.012, 0.014), soaked);\n"
	"	vec3 albedo = mix(cloth_rgb, c.rgb * c.rgb * below, skin);\n"
	"	wet = max(wet, moist) * skin;\n"
	"	const vec3 wrap = vec3(0.32, 0.16, 0.10);\n"
	"	float nl = dot(n, light.xyz);\n"
	"	vec3 key = max((nl + wrap) / (1.0 + wrap), 0.0) * light.w;\n"
	"	float nu = 0.5 + 0.5 * dot(n, up);\n"
	"	vec3 around = mix(vec3(0.13, 0.08, 0.07), vec3(0.30, 0.32, 0.36), nu);\n"
	"	around *= 0.5 + 0.5 * light.w;\n"
	"	float a2 = mix(0.22, 0.010, wet);\n"
	"	float nh = max(dot(n, half_way), 0.0);\n"
	"	float d = nh * nh * (a2 - 1.0) + 1.0;\n"
	"	float shine = a2 / (d * d) * mix(0.016 * skin, 0.006, wet) * min(4.0 * c.r, 1.0);\n"
	"	shine = min(shine, 0.8) * clamp(3.0 * nl, 0.0, 1.0) * light.w;\n"
	"	vec3 lit = albedo * (key * vec3(1.10, 1.02, 0.92) + around) + shine;\n"
	"	colour = vec4(sqrt(lit), 1.0);\n"
	"}\n";

static const char instrument_vs[] =
	HEAD "layout(location = 0) in vec3 in_0;\n" /* place, mm */
	     "layout(location = 1) in vec3 in_1;\n" /* normal */
	     "layout(location = 2) in vec4 in_2;\n" /* sRGB, metal */
	     "uniform mat4 clip, place;\n"
	     "uniform vec3 camera;\n"
	     "out vec3 normal, to_camera;\n"
	     "out vec4 stuff;\n"
	     "void main()\n"
	     "{\n"
	     "	vec4 p = place * vec4(in_0, 1);\n"
	     "	normal = mat3(place) * in_1;\n"
	     "	to_camera = camera - p.xyz;\n"
	     "	stuff = vec4(in_2.rgb * in_2.rgb, in_2.a);\n"
	     "	gl_Position = clip * p;\n"
	     "}\n";

/*
 * Metal reflects a room: a bright ceiling with a lamp, a window in front, skin below.
 */
static const char instrument_fs[] = HEAD
	"in vec3 normal, to_camera;\n"
	"in vec4 stuff;\n"
	"uniform vec3 key, sky;\n"
	"out vec4 colour;\n"
	"void main()\n"
	"{\n"
	"	vec3 n = normalize(normal), v = normalize(to_camera);\n"
	"	float nl = max(dot(n, key), 0.0), nu = 0.5 + 0.5 * dot(n, sky);\n"
	"	vec3 r = reflect(-v, n);\n"
	"	float ru = dot(r, sky), rk = max(dot(r, key), 0.0);\n"
	"	float room = mix(0.16, 0.80, smoothstep(-0.45, 0.45, ru)) - 0.25 * smoothstep(0.5, 0.95, ru);\n"
	"	room += 0.55 * smoothstep(0.35, 0.95, dot(r, vec3(0.55, -0.72, 0.42)));\n"
	"	float lamp = pow(rk, 90.0) * 2.5 + pow(rk, 12.0) * 0.25;\n"
	"	float rim = pow(1.0 - max(dot(n, v), 0.0), 4.0);\n"
	"	vec3 plastic = stuff.rgb * (nl * 0.8 + mix(0.12, 0.42, nu)) + (0.03 + 0.4 * rim) * room + 0.1 * lamp;\n"
	"	vec3 floor = vec3(0.62, 0.40, 0.33) * clamp(-1.3 * ru, 0.0, 1.0) * (0.4 + 0.6 * smoothstep(-0.2, 0.7, r.x));\n"
	"	vec3 metal = stuff.rgb * (room + floor + lamp + 0.10 * nl);\n"
	"	colour = vec4(sqrt(mix(plastic, metal, stuff.a)), 1.0);\n"
	"}\n";

/* One triangle over everything; a soft light in the middle of a dark room. */
static const char ground_vs[] =
	HEAD "out vec2 at;\n"
	     "void main()\n"
	     "{\n"
	     "	at = vec2((gl_VertexID << 1) & 2, gl_VertexID & 2) * 2.0 - 1.0;\n"
	     "	gl_Position = vec4(at, 1.0, 1.0);\n"
	     "}\n";

static const char ground_fs[] = HEAD
	"in vec2 at;\n"
	"out vec4 colour;\n"
	"void main()\n"
	"{\n"
	"	vec3 c = mix(vec3(0.10, 0.13, 0.15), vec3(0.30, 0.36, 0.38), 0.5 + 0.5 * at.y);\n"
	"	colour = vec4(c * (1.0 - 0.22 * dot(at, at)), 1.0);\n"
	"}\n";

static const char image_vs[] =
	HEAD "uniform vec4 box;\n" /* left, top, right, bottom in clip space */
	     "out vec2 uv;\n"
	     "void main()\n"
	     "{\n"
	     "	uv = vec2(gl_VertexID & 1, gl_VertexID >> 1);\n"
	     "	gl_Position = vec4(mix(box.xy, box.zw, uv), 0.0, 1.0);\n"
	     "}\n";

static const char image_fs[] = HEAD "in vec2 uv;\n"
				    "uniform sampler2D image;\n"
				    "out vec4 colour;\n"
				    "void main()\n"
				    "{\n"
				    "	colour = texture(image, uv);\n"
				    "}\n";

static unsigned compile(const char *what, GLenum kind, const char *text,
			struct incise_error *err)
{
	unsigned shader = glCreateShader(kind);
	char log[300] = "";
	int good = 0;

	glShaderSource(shader, 1, &text, NULL);
	glCompileShader(shader);
	glGetShaderiv(shader, GL_COMPILE_STATUS, &good);
	if (good)
		return shader;
	glGetShaderInfoLog(shader, sizeof(log), NULL, log);
	glDeleteShader(shader);
	incise_error_set(err, EIO, "image: %s: the graphics driver rejects a shader: %s",
			 what, log);
	return 0;
}

static unsigned link(const char *what, unsigned vs, unsigned fs, struct incise_error *err)
{
	unsigned program = glCreateProgram();
	char log[300] = "";
	int good = 0;

	glAttachShader(program, vs);
	glAttachShader(program, fs);
	glLinkProgram(program);
	glGetProgramiv(program, GL_LINK_STATUS, &good);
	if (good)
		return program;
	glGetProgramInfoLog(program, sizeof(log), NULL, log);
	glDeleteProgram(program);
	incise_error_set(err, EIO, "image: %s: the graphics driver rejects a program: %s",
			 what, log);
	return 0;
}

unsigned shader_program(enum shader shader, struct incise_error *err)
{
	static const struct {
		const char *what, *vs, *fs;
	} texts[SHADERS] = {
		[SHADER_SURFACE] = {"skin", surface_vs, surface_fs},
		[SHADER_INSTRUMENT] = {"instrument", instrument_vs, instrument_fs},
		[SHADER_GROUND] = {"ground", ground_vs, ground_fs},
		[SHADER_IMAGE] = {"image", image_vs, image_fs},
	};
	const char *what = texts[shader].what;
	unsigned v = compile(what, GL_VERTEX_SHADER, texts[shader].vs, err);
	unsigned f = v ? compile(what, GL_FRAGMENT_SHADER, texts[shader].fs, err) : 0;
	unsigned program = f ? link(what, v, f, err) : 0;

	/* The program keeps them alive. */
	if (v)
		glDeleteShader(v);
	if (f)
		glDeleteShader(f);
	return program;
}
