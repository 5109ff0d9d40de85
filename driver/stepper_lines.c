// SPDX-License-Identifier: GPL-2.0-only
/*
 * The GPIO lines of a controller and their interrupts. A line is looked for at the
 * motor's firmware node (device tree, ACPI), else in the lookup table of the controller,
 * for example by configfs, where it goes by motorN-NAME:
 *
 *   motor@0 { step-gpios = <…>; };      or      GPIO_LOOKUP(chip, 4, "motor0-step", 0)
 *
 * Edges are written in hard interrupts, so that the driver refuses a line whose chip may
 * sleep (an expander on I2C) here, by name.
 */
#include <linux/device.h>
#include <linux/gpio/consumer.h>
#include <linux/interrupt.h>
#include <linux/ktime.h>
#include <linux/property.h>

#include "compat.h"
#include "stepper.h"
#include "stepper_wires.h"

static const char *const stepper_input_names[STEPPER_INPUTS] = {
	"limit-min", "limit-max", "home", "estop", "fault",
};

#define STEPPER_KEY_SIZE 32

/* A line's name in the lookup table, and in messages. */
static void stepper_lines_key(char *key, int motor, const char *name)
{
	if (motor < 0)
		snprintf(key, STEPPER_KEY_SIZE, "%s", name);
	else
		snprintf(key, STEPPER_KEY_SIZE, "motor%d-%s", motor, name);
}

/*
 * Report an error of a line and return it. A device of configfs is not probed again when
 * a chip appears, so that a deferral, which dev_err_probe() keeps to itself, is an error.
 */
static int stepper_lines_fail(struct device *dev, int ret, const char *key,
			      const char *why)
{
	const char *label = stepper_nodes_label(dev, key);

	if (!label)
		return dev_err_probe(dev, ret, "line %s: %s\n", key, why);
	if (ret == -EPROBE_DEFER) {
		dev_err(dev, "line %s: no chip labelled %s\n", key, label);
		return -ENODEV;
	}
	dev_err(dev, "line %s of %s: %s: %pe\n", key, label, why, ERR_PTR(ret));
	return ret;
}

/* A line, NULL if it is optional and absent, or an error that was reported. */
static struct gpio_desc *stepper_lines_one(struct device *dev, struct fwnode_handle *node,
					   int motor, const char *name,
					   enum gpiod_flags flags, bool needed)
{
	struct gpio_desc *line = ERR_PTR(-ENOENT);
	char key[STEPPER_KEY_SIZE];

	stepper_lines_key(key, motor, name);
	if (node && !is_software_node(node))
		line = devm_fwnode_gpiod_get(dev, node, name, flags, key);
	if (PTR_ERR_OR_ZERO(line) == -ENOENT)
		line = devm_gpiod_get(dev, key, flags);
	if (PTR_ERR_OR_ZERO(line) == -ENOENT && !needed)
		return NULL;
	if (IS_ERR(line))
		return ERR_PTR(stepper_lines_fail(dev, PTR_ERR(line), key,
						  "it is not available"));
	if (flags != GPIOD_IN && node && !stepper_node_push_pull(node, name))
		return ERR_PTR(stepper_lines_fail(
			dev, -EOPNOTSUPP, key,
			"an open-drain output may sleep, an interrupt may not"));
	if (gpiod_cansleep(line))
		return ERR_PTR(
			stepper_lines_fail(dev, -EOPNOTSUPP, key,
					   "its chip may sleep, an interrupt may not"));
	return line;
}

static int stepper_lines_motor(struct stepper_motor *motor, struct device *dev,
			       struct fwnode_handle *node)
{
	struct stepper_lines *lines = &motor->lines;
	u32 has = INCISE_STEPPER_LINE_DIR;
	int n = motor->index;
	enum stepper_input i;

	lines->step = stepper_lines_one(dev, node, n, "step", GPIOD_OUT_LOW, true);
	if (IS_ERR(lines->step))
		return PTR_ERR(lines->step);
	lines->dir = stepper_lines_one(dev, node, n, "dir", GPIOD_OUT_LOW, true);
	if (IS_ERR(lines->dir))
		return PTR_ERR(lines->dir);
	lines->enable = stepper_lines_one(dev, node, n, "enable", GPIOD_OUT_LOW, false);
	if (IS_ERR(lines->enable))
		return PTR_ERR(lines->enable);
	if (lines->enable)
		has |= INCISE_STEPPER_LINE_ENABLE;

	for (i = 0; i < STEPPER_INPUTS; i++) {
		struct gpio_desc *line = motor->stepper->estop;

		if (i != STEPPER_ESTOP)
			line = stepper_lines_one(dev, node, n, stepper_input_names[i],
						 GPIOD_IN, false);
		if (IS_ERR(line))
			return PTR_ERR(line);
		lines->input[i] = line;
		if (line)
			has |= 1U << i;
	}
	motor->stepper->info.lines[n] = has;
	return 0;
}

/* Get all lines, outputs inactive. They go with the device. */
int stepper_lines_get(struct stepper *stepper, struct device *dev)
{
	struct fwnode_handle *root = dev_fwnode(dev);
	unsigned int i;
	int ret;

	stepper->estop = stepper_lines_one(dev, root, -1, "estop", GPIOD_IN, false);
	if (IS_ERR(stepper->estop))
		return PTR_ERR(stepper->estop);
	stepper->sync.line =
		stepper_lines_one(dev, root, -1, "sync", GPIOD_OUT_LOW, false);
	if (IS_ERR(stepper->sync.line))
		return PTR_ERR(stepper->sync.line);
	if (stepper->sync.line)
		stepper->info.capabilities |= INCISE_STEPPER_CAP_SYNC;

	for (i = 0; i < stepper->n_motors; i++) {
		struct fwnode_handle *node;

		node = stepper_node_motor(dev, i);
		ret = stepper_lines_motor(&stepper->motor[i], dev, node);
		fwnode_handle_put(node);
		if (ret)
			return ret;
	}
	return 0;
}

/* More edges in a time than a contact has: ticks look at the input until it has calmed down. */
#define STORM_EDGES 32
#define STORM_NS NSEC_PER_MSEC
#define CALM_MS 100

static void stepper_lines_bound(struct stepper_irq *from, int irq, s64 now)
{
	if (now - from->window_ns > STORM_NS) {
		from->window_ns = now;
		from->edges = 0;
	}
	if (++from->edges < STORM_EDGES)
		return;
	disable_irq_nosync(irq);
	from->storms++;
	WRITE_ONCE(from->masked, true);
	schedule_delayed_work(&from->stepper->calm, msecs_to_jiffies(CALM_MS));
}

static void stepper_lines_unmask(struct stepper_irq *irq)
{
	if (!READ_ONCE(irq->masked))
		return;
	irq->edges = 0;
	WRITE_ONCE(irq->masked, false);
	enable_irq(irq->irq);
}

static void stepper_lines_calm(struct work_struct *work)
{
	struct stepper *stepper =
		container_of(to_delayed_work(work), struct stepper, calm);
	enum stepper_input input;
	unsigned long flags;
	unsigned int i;

	stepper_lines_unmask(&stepper->estop_irq);
	for (i = 0; i < stepper->n_motors; i++) {
		struct stepper_motor *motor = &stepper->motor[i];

		for (input = 0; input < STEPPER_INPUTS; input++)
			stepper_lines_unmask(&motor->lines.irq[input]);
		raw_spin_lock_irqsave(&motor->lock, flags);
		stepper_inputs_sample(motor, ktime_get_ns());
		stepper_status_publish(motor, ktime_get_ns());
		raw_spin_unlock_irqrestore(&motor->lock, flags);
	}
}

void stepper_lines_init(struct stepper *stepper)
{
	INIT_DELAYED_WORK(&stepper->calm, stepper_lines_calm);
}

static irqreturn_t stepper_lines_interrupt(int irq, void *data)
{
	struct stepper_irq *from = data;
	struct stepper *stepper = from->stepper;
	s64 now = ktime_get_ns();
	unsigned long flags;
	unsigned int i;

	for (i = 0; i < stepper->n_motors; i++) {
		struct stepper_motor *motor = &stepper->motor[i];

		if (from->motor >= 0 && from->motor != (int)i)
			continue;
		raw_spin_lock_irqsave(&motor->lock, flags);
		stepper_inputs_one(motor, from->input, now, true);
		stepper_status_publish(motor, now);
		raw_spin_unlock_irqrestore(&motor->lock, flags);
	}
	stepper_lines_bound(from, irq, now);
	return IRQ_HANDLED;
}

/* Its chip has no interrupts: the looks at each tick and step serve it, and info says so. */
static void stepper_lines_poll(struct stepper *stepper, int motor,
			       enum stepper_input input, const char *key)
{
	unsigned int i;

	for (i = 0; i < stepper->n_motors; i++)
		if (motor < 0 || motor == (int)i)
			stepper->info.polled[i] |= 1U << input;
	dev_notice(stepper->parent, "line %s: no interrupt, read at each tick\n", key);
}

static int stepper_lines_request(struct stepper *stepper, struct stepper_irq *irq,
				 struct gpio_desc *line, int motor,
				 enum stepper_input input)
{
	char key[STEPPER_KEY_SIZE];
	int number, ret;

	if (!line)
		return 0;
	stepper_lines_key(key, motor, stepper_input_names[input]);
	number = gpiod_to_irq(line);
	if (!number || number == -ENXIO) {
		stepper_lines_poll(stepper, motor, input, key);
		return 0;
	}
	if (number < 0)
		return stepper_lines_fail(stepper->parent, number, key,
					  "its chip gives no interrupt");
	irq->stepper = stepper;
	irq->motor = motor;
	irq->input = input;
	/* Hard on PREEMPT_RT too: a stop must not wait for a thread. */
	ret = request_irq(number, stepper_lines_interrupt,
			  IRQF_TRIGGER_RISING | IRQF_TRIGGER_FALLING | IRQF_NO_THREAD,
			  dev_name(&stepper->dev), irq);
	if (ret)
		return stepper_lines_fail(stepper->parent, ret, key,
					  "its interrupt is not available");
	irq->irq = number;
	return 0;
}

/* Interrupts from now on, and the present state of the inputs. */
int stepper_lines_listen(struct stepper *stepper)
{
	enum stepper_input input;
	unsigned long flags;
	unsigned int i;
	int ret;

	ret = stepper_lines_request(stepper, &stepper->estop_irq, stepper->estop, -1,
				    STEPPER_ESTOP);
	for (i = 0; !ret && i < stepper->n_motors; i++) {
		struct stepper_motor *motor = &stepper->motor[i];

		for (input = 0; !ret && input < STEPPER_INPUTS; input++)
			if (input != STEPPER_ESTOP)
				ret = stepper_lines_request(stepper,
							    &motor->lines.irq[input],
							    motor->lines.input[input], i,
							    input);
		raw_spin_lock_irqsave(&motor->lock, flags);
		stepper_inputs_sample(motor, ktime_get_ns());
		stepper_status_publish(motor, ktime_get_ns());
		raw_spin_unlock_irqrestore(&motor->lock, flags);
	}
	if (ret)
		stepper_lines_ignore(stepper);
	return ret;
}

static void stepper_lines_silence(struct stepper_irq *irq)
{
	if (irq->irq)
		disable_irq(irq->irq);
}

static void stepper_lines_release(struct stepper_irq *irq)
{
	if (irq->irq)
		free_irq(irq->irq, irq);
	irq->irq = 0;
}

/* No interrupt any more when this returns. */
void stepper_lines_ignore(struct stepper *stepper)
{
	enum stepper_input input;
	unsigned int i;

	/* Then no storm begins, and then none is waited for. */
	stepper_lines_silence(&stepper->estop_irq);
	for (i = 0; i < stepper->n_motors; i++)
		for (input = 0; input < STEPPER_INPUTS; input++)
			stepper_lines_silence(&stepper->motor[i].lines.irq[input]);
	cancel_delayed_work_sync(&stepper->calm);
	stepper_lines_release(&stepper->estop_irq);
	for (i = 0; i < stepper->n_motors; i++)
		for (input = 0; input < STEPPER_INPUTS; input++)
			stepper_lines_release(&stepper->motor[i].lines.irq[input]);
}
