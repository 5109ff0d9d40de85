// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Pictures of a chessboard through a camera whose truth is known, for the tests of incise
 * calibrate depth: a pinhole with Brown's lens, edges averaged over 8 x 8 samples a pixel.
 *
 *     draw SEED FOLDER     writes FOLDER/view1.pgm … view7.pgm, prints the truth as JSON
 *
 *     ■□■□■   10 x 7 squares of 5 mm in white; the first view lies in the cutting plane,
 *     □■□■□   1.5 degrees off the picture's; the others are tilted by 20 to 40 degrees
 *
 * It shares nothing with the library, so that a mistake is not made twice.
 */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define WIDTH 640
#define HEIGHT 480
#define VIEWS 7
#define COLUMNS 10 /* squares */
#define ROWS 7
#define SQUARE 5.0
#define SAMPLES 8
#define NOISE 2.0
#define SOFT_PX 0.7 /* half of a lens's blur; samples are taken from so much more */

struct camera {
	double f, cx, cy, k1, k2, p1, p2;
};

struct pose {
	double x[3], y[3], z[3], at[3]; /* the board's axes and its middle, mm */
};

static uint64_t state;

static double uniform(void)
{
	uint64_t z = state += 0x9e3779b97f4a7c15u;

	z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
	z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
	return ((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

static double gauss(void)
{
	double sum = 0;

	for (int i = 0; i < 12; i++)
		sum += uniform();
	return sum - 6;
}

/* Lean about an axis in the picture, then turn about the line of sight. */
static void make_pose(struct pose *p, double lean, double way, double turn, double far)
{
	double a[3] = {cos(way), sin(way), 0}, axes[3][3];

	for (int k = 0; k < 3; k++) {
		double v[3] = {k == 0, k == 1, k == 2}, dot = 0, w[3], c = v[0], s = v[1];

		v[0] = c * cos(turn) - s * sin(turn);
		v[1] = c * sin(turn) + s * cos(turn);
		for (int i = 0; i < 3; i++)
			dot += a[i] * v[i];
		w[0] = a[1] * v[2] - a[2] * v[1];
		w[1] = a[2] * v[0] - a[0] * v[2];
		w[2] = a[0] * v[1] - a[1] * v[0];
		for (int i = 0; i < 3; i++)
			axes[k][i] = v[i] * cos(lean) + w[i] * sin(lean) +
				     a[i] * dot * (1 - cos(lean));
	}
	for (int i = 0; i < 3; i++) {
		p->x[i] = axes[0][i];
		p->y[i] = axes[1][i];
		p->z[i] = axes[2][i];
	}
	p->at[0] = 4 * (uniform() - 0.5);
	p->at[1] = 4 * (uniform() - 0.5);
	p->at[2] = far;
}

/* mm on the board of what is seen at a place in the picture. */
static void board_at(const struct camera *c, const struct pose *p, double px, double py,
		     double *u, double *v)
{
	double wx = (px - c->cx) / c->f, wy = (py - c->cy) / c->f, x = wx, y = wy;
	double ray[3], far, top = 0, bottom = 0, off[3];

	for (int i = 0; i < 12; i++) {
		double r2 = x * x + y * y, radial = 1 + c->k1 * r2 + c->k2 * r2 * r2;
		double nx = (wx - 2 * c->p1 * x * y - c->p2 * (r2 + 2 * x * x)) / radial;
		double ny = (wy - c->p1 * (r2 + 2 * y * y) - 2 * c->p2 * x * y) / radial;

		x = nx;
		y = ny;
	}
	ray[0] = x;
	ray[1] = y;
	ray[2] = 1;
	for (int i = 0; i < 3; i++) {
		top += p->z[i] * p->at[i];
		bottom += p->z[i] * ray[i];
	}
	far = top / bottom;
	*u = *v = 0;
	for (int i = 0; i < 3; i++) {
		off[i] = far * ray[i] - p->at[i];
		*u += off[i] * p->x[i];
		*v += off[i] * p->y[i];
	}
}

static double ink(double u, double v)
{
	int i = (int)floor(u / SQUARE + COLUMNS / 2.0);
	int j = (int)floor(v / SQUARE + ROWS / 2.0);

	if (i < 0 || j < 0 || i >= COLUMNS || j >= ROWS || (i + j) % 2)
		return 215;
	return 35;
}

static void draw(const struct camera *c, const struct pose *p, const char *path)
{
	static double grid[HEIGHT + 1][WIDTH + 1][2];
	FILE *file = fopen(path, "wb");

	if (!file)
		exit(1);
	/* The board's mm at the pixels' corners; within a pixel they are as good as linear. */
	for (int y = 0; y <= HEIGHT; y++)
		for (int x = 0; x <= WIDTH; x++)
			board_at(c, p, x, y, &grid[y][x][0], &grid[y][x][1]);
	fprintf(file, "P5\n%d %d\n255\n", WIDTH, HEIGHT);
	for (int y = 0; y < HEIGHT; y++)
		for (int x = 0; x < WIDTH; x++) {
			double sum = 0;

			for (int n = 0; n < SAMPLES * SAMPLES; n++) {
				double a = (n % SAMPLES + 0.5) / SAMPLES, at[2];
				double b = (n / SAMPLES + 0.5) / SAMPLES;

				/* beyond the pixel's borders, to both sides alike */
				a = 0.5 + (a - 0.5) * (1 + 2 * SOFT_PX);
				b = 0.5 + (b - 0.5) * (1 + 2 * SOFT_PX);
				for (int k = 0; k < 2; k++)
					at[k] = (1 - b) * ((1 - a) * grid[y][x][k] +
							   a * grid[y][x + 1][k]) +
						b * ((1 - a) * grid[y + 1][x][k] +
						     a * grid[y + 1][x + 1][k]);
				sum += ink(at[0], at[1]);
			}
			fputc((int)(sum / SAMPLES / SAMPLES + NOISE * gauss() + 0.5),
			      file);
		}
	if (fclose(file))
		exit(1);
}

int main(int argc, char **argv)
{
	struct camera c;
	struct pose pose[VIEWS];
	double u[2], v[2];

	if (argc != 3)
		return 2;
	state = strtoull(argv[1], NULL, 10) * 0x2545f4914f6cdd1du;
	c = (struct camera){
		.f = 950 + 200 * uniform(),
		.cx = 310 + 20 * uniform(),
		.cy = 230 + 20 * uniform(),
		.k1 = -0.25 + 0.2 * uniform(),
		.k2 = 0.1 * uniform(),
		.p1 = 0.002 * (uniform() - 0.5),
		.p2 = 0.002 * (uniform() - 0.5),
	};
	for (int i = 0; i < VIEWS; i++) {
		char path[400];

		make_pose(&pose[i], (i ? 20 + 20 * uniform() : 1.5) * M_PI / 180,
			  2 * M_PI * (i + 0.5 * uniform()) / (VIEWS - 1),
			  0.2 * (uniform() - 0.5), c.f * (0.115 + 0.01 * uniform()));
		snprintf(path, sizeof(path), "%s/view%d.pgm", argv[2], i + 1);
		draw(&c, &pose[i], path);
	}
	/* Along the upright in the middle, from a tenth to nine tenths, as is the default. */
	board_at(&c, &pose[0], WIDTH / 2.0, 0.1 * HEIGHT, &u[0], &v[0]);
	board_at(&c, &pose[0], WIDTH / 2.0, 0.9 * HEIGHT, &u[1], &v[1]);
	printf("{\"f\": %.9g, \"cx\": %.9g, \"cy\": %.9g, \"k1\": %.9g, \"tilt_deg\": 1.5, "
	       "\"mm_px\": %.12g}\n",
	       c.f, c.cx, c.cy, c.k1, hypot(u[1] - u[0], v[1] - v[0]) / (0.8 * HEIGHT));
	return 0;
}
