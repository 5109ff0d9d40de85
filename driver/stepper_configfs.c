// SPDX-License-Identifier: GPL-2.0-only
/*
 * Controllers without a device tree:
 *
 *   cd /sys/kernel/config/incise-stepper
 *   mkdir bench bench/motor0
 *   echo incise-sim:0 >bench/motor0/step
 *   echo incise-sim:2:active-low >bench/motor0/enable
 *   echo 1 >bench/live                  binds; cdev says which node it is
 *   echo 0 >bench/live                  unbinds
 *
 * A line is LABEL:OFFSET[:active-low][:pull-up|:pull-down], or nothing where it is not wired.
 * Numbers of a motor are those of its config until a program sets others.
 * While live nothing can be changed (EBUSY) and nothing removed.
 */
#include <linux/configfs.h>
#include <linux/device.h>
#include <linux/gpio/machine.h>
#include <linux/module.h>
#include <linux/mutex.h>
#include <linux/slab.h>
#include <linux/string.h>

#include "stepper.h"
#include "stepper_wires.h"

#define LABEL_MAX 63

const char *const stepper_wire_names[STEPPER_WIRES] = {"estop", "sync"};
const char *const stepper_motor_wire_names[STEPPER_MOTOR_WIRES] = {
	"step", "dir", "enable", "limit-min", "limit-max", "home", "fault",
};

/* A folder of a controller. */
struct stepper_folder {
	struct config_group group;
	struct mutex mutex; /* all below */
	struct stepper_wires wires;
	struct config_item *motor[INCISE_STEPPER_MOTORS_MAX];
	struct stepper_nodes *live;
};

/* A motor's folder in it. */
struct stepper_motor_folder {
	struct config_group group;
	struct stepper_folder *folder;
	unsigned int motor;
};

static struct configfs_subsystem stepper_configfs;

static struct stepper_folder *to_folder(struct config_item *item)
{
	return container_of(to_config_group(item), struct stepper_folder, group);
}

static struct stepper_motor_folder *to_motor_folder(struct config_item *item)
{
	return container_of(to_config_group(item), struct stepper_motor_folder, group);
}

static const struct {
	const char *word;
	unsigned long flag;
} stepper_wire_words[] = {
	{":active-low", GPIO_ACTIVE_LOW},
	{":pull-up", GPIO_PULL_UP},
	{":pull-down", GPIO_PULL_DOWN},
};

static ssize_t stepper_wire_show(struct stepper_folder *folder,
				 const struct stepper_wire *wire, char *page)
{
	int i, n = 0;

	mutex_lock(&folder->mutex);
	if (wire->label) {
		n = sysfs_emit(page, "%s:%u", wire->label, wire->offset);
		for (i = 0; i < ARRAY_SIZE(stepper_wire_words); i++)
			if (wire->flags & stepper_wire_words[i].flag)
				n += sysfs_emit_at(page, n, "%s",
						   stepper_wire_words[i].word);
		n += sysfs_emit_at(page, n, "\n");
	}
	mutex_unlock(&folder->mutex);
	return n;
}

/* Takes a word away from the end of a line; 0: there is none. */
static unsigned long stepper_wire_word(char *text)
{
	size_t n = strlen(text);
	int i;

	for (i = 0; i < ARRAY_SIZE(stepper_wire_words); i++) {
		size_t length = strlen(stepper_wire_words[i].word);

		if (n <= length || strcmp(text + n - length, stepper_wire_words[i].word))
			continue;
		text[n - length] = '\0';
		return stepper_wire_words[i].flag;
	}
	return 0;
}

/* LABEL:OFFSET and words in any order; a label may have a ':' of its own. */
static int stepper_wire_parse(struct stepper_wire *wire, char *text)
{
	const unsigned long both = GPIO_PULL_UP | GPIO_PULL_DOWN;
	unsigned long flag;
	char *colon;
	int ret;

	*wire = (struct stepper_wire){};
	if (!*text)
		return 0;
	while ((flag = stepper_wire_word(text)))
		wire->flags |= flag;
	if ((wire->flags & both) == both)
		return -EINVAL;
	colon = strrchr(text, ':');
	if (!colon || colon == text)
		return -EINVAL;
	*colon = '\0';
	/* A node of the label's name will stand for the chip. */
	if (strlen(text) > LABEL_MAX)
		return -ENAMETOOLONG;
	ret = kstrtouint(colon + 1, 10, &wire->offset);
	if (ret)
		return ret;
	/* U16_MAX means "by the line's name" in a lookup table. */
	if (wire->offset >= U16_MAX)
		return -EINVAL;
	wire->label = kstrdup(text, GFP_KERNEL);
	return wire->label ? 0 : -ENOMEM;
}

static ssize_t stepper_wire_store(struct stepper_folder *folder,
				  struct stepper_wire *wire, const char *page, size_t n)
{
	struct stepper_wire parsed;
	char *text;
	int ret;

	text = kstrndup(page, n, GFP_KERNEL);
	if (!text)
		return -ENOMEM;
	ret = stepper_wire_parse(&parsed, strim(text));
	kfree(text);
	if (ret)
		return ret;

	mutex_lock(&folder->mutex);
	if (folder->live)
		ret = -EBUSY;
	else
		swap(*wire, parsed);
	mutex_unlock(&folder->mutex);
	kfree(parsed.label);
	return ret ? ret : (ssize_t)n;
}

/* The folder of the controller that a motor's folder lies in, and its wires. */
static struct stepper_folder *motor_folder_of(struct config_item *item)
{
	return to_motor_folder(item)->folder;
}

static struct stepper_wire *motor_wires(struct config_item *item)
{
	struct stepper_motor_folder *motor = to_motor_folder(item);

	return motor->folder->wires.motor[motor->motor];
}

#define STEPPER_MOTOR_LINE(_name, _wire)                                            \
	static ssize_t stepper_motor_##_name##_show(struct config_item *item,       \
						    char *page)                     \
	{                                                                           \
		return stepper_wire_show(motor_folder_of(item),                     \
					 motor_wires(item) + STEPPER_WIRE_##_wire,  \
					 page);                                     \
	}                                                                           \
	static ssize_t stepper_motor_##_name##_store(struct config_item *item,      \
						     const char *page, size_t n)    \
	{                                                                           \
		return stepper_wire_store(motor_folder_of(item),                    \
					  motor_wires(item) + STEPPER_WIRE_##_wire, \
					  page, n);                                 \
	}                                                                           \
	CONFIGFS_ATTR(stepper_motor_, _name)

STEPPER_MOTOR_LINE(step, STEP);
STEPPER_MOTOR_LINE(dir, DIR);
STEPPER_MOTOR_LINE(enable, ENABLE);
STEPPER_MOTOR_LINE(limit_min, LIMIT_MIN);
STEPPER_MOTOR_LINE(limit_max, LIMIT_MAX);
STEPPER_MOTOR_LINE(home, HOME);
STEPPER_MOTOR_LINE(fault, FAULT);

static ssize_t stepper_number_store(struct config_item *item, u32 *number,
				    const char *page, size_t n)
{
	struct stepper_folder *folder = motor_folder_of(item);
	u32 value;
	int ret;

	ret = kstrtou32(page, 10, &value);
	if (ret)
		return ret;
	mutex_lock(&folder->mutex);
	if (folder->live)
		ret = -EBUSY;
	else
		WRITE_ONCE(*number, value);
	mutex_unlock(&folder->mutex);
	return ret ? ret : (ssize_t)n;
}

#define STEPPER_MOTOR_NUMBER(_name)                                                 \
	static u32 *stepper_motor_##_name##_of(struct config_item *item)            \
	{                                                                           \
		struct stepper_motor_folder *motor = to_motor_folder(item);         \
		return &motor->folder->wires._name[motor->motor];                   \
	}                                                                           \
	static ssize_t stepper_motor_##_name##_show(struct config_item *item,       \
						    char *page)                     \
	{                                                                           \
		return sysfs_emit(page, "%u\n",                                     \
				  READ_ONCE(*stepper_motor_##_name##_of(item)));    \
	}                                                                           \
	static ssize_t stepper_motor_##_name##_store(struct config_item *item,      \
						     const char *page, size_t n)    \
	{                                                                           \
		return stepper_number_store(item, stepper_motor_##_name##_of(item), \
					    page, n);                               \
	}

STEPPER_MOTOR_NUMBER(lost_steps_max)
CONFIGFS_ATTR(stepper_motor_, lost_steps_max);
STEPPER_MOTOR_NUMBER(debounce_ns)
CONFIGFS_ATTR(stepper_motor_, debounce_ns);
STEPPER_MOTOR_NUMBER(cpu)
CONFIGFS_ATTR(stepper_motor_, cpu);

static struct configfs_attribute *stepper_motor_attrs[] = {
	&stepper_motor_attr_step,
	&stepper_motor_attr_dir,
	&stepper_motor_attr_enable,
	&stepper_motor_attr_limit_min,
	&stepper_motor_attr_limit_max,
	&stepper_motor_attr_home,
	&stepper_motor_attr_fault,
	&stepper_motor_attr_debounce_ns,
	&stepper_motor_attr_cpu,
	&stepper_motor_attr_lost_steps_max,
	NULL,
};

static void stepper_motor_folder_release(struct config_item *item)
{
	struct stepper_motor_folder *motor = to_motor_folder(item);

	config_item_put(&motor->folder->group.cg_item);
	kfree(motor);
}

static struct configfs_item_operations stepper_motor_folder_ops = {
	.release = stepper_motor_folder_release,
};

static const struct config_item_type stepper_motor_folder_type = {
	.ct_item_ops = &stepper_motor_folder_ops,
	.ct_attrs = stepper_motor_attrs,
	.ct_owner = THIS_MODULE,
};

static struct config_group *stepper_motor_folder_make(struct config_group *group,
						      const char *name)
{
	struct stepper_folder *folder = to_folder(&group->cg_item);
	struct stepper_motor_folder *motor;
	int ret = 0;

	if (strlen(name) != 6 || strncmp(name, "motor", 5) || name[5] < '0' ||
	    name[5] >= '0' + INCISE_STEPPER_MOTORS_MAX)
		return ERR_PTR(-EINVAL);
	motor = kzalloc(sizeof(*motor), GFP_KERNEL);
	if (!motor)
		return ERR_PTR(-ENOMEM);
	motor->motor = name[5] - '0';

	mutex_lock(&folder->mutex);
	if (folder->live) {
		ret = -EBUSY;
	} else {
		config_item_get(&folder->group.cg_item);
		motor->folder = folder;
		config_group_init_type_name(&motor->group, name,
					    &stepper_motor_folder_type);
		folder->motor[motor->motor] = &motor->group.cg_item;
	}
	mutex_unlock(&folder->mutex);
	if (ret) {
		kfree(motor);
		return ERR_PTR(ret);
	}
	return &motor->group;
}

static void stepper_motor_folder_drop(struct config_group *group,
				      struct config_item *item)
{
	struct stepper_folder *folder = to_folder(&group->cg_item);
	struct stepper_motor_folder *motor = to_motor_folder(item);
	int i;

	mutex_lock(&folder->mutex);
	folder->motor[motor->motor] = NULL;
	folder->wires.lost_steps_max[motor->motor] = 0;
	folder->wires.debounce_ns[motor->motor] = 0;
	folder->wires.cpu[motor->motor] = 0;
	for (i = 0; i < STEPPER_MOTOR_WIRES; i++) {
		kfree(folder->wires.motor[motor->motor][i].label);
		folder->wires.motor[motor->motor][i] = (struct stepper_wire){};
	}
	mutex_unlock(&folder->mutex);
	config_item_put(item);
}

static ssize_t stepper_folder_estop_show(struct config_item *item, char *page)
{
	struct stepper_folder *folder = to_folder(item);

	return stepper_wire_show(folder, &folder->wires.wire[STEPPER_WIRE_ESTOP], page);
}

static ssize_t stepper_folder_estop_store(struct config_item *item, const char *page,
					  size_t n)
{
	struct stepper_folder *folder = to_folder(item);

	return stepper_wire_store(folder, &folder->wires.wire[STEPPER_WIRE_ESTOP], page,
				  n);
}
CONFIGFS_ATTR(stepper_folder_, estop);

static ssize_t stepper_folder_sync_show(struct config_item *item, char *page)
{
	struct stepper_folder *folder = to_folder(item);

	return stepper_wire_show(folder, &folder->wires.wire[STEPPER_WIRE_SYNC], page);
}

static ssize_t stepper_folder_sync_store(struct config_item *item, const char *page,
					 size_t n)
{
	struct stepper_folder *folder = to_folder(item);

	return stepper_wire_store(folder, &folder->wires.wire[STEPPER_WIRE_SYNC], page,
				  n);
}
CONFIGFS_ATTR(stepper_folder_, sync);

/* Name of the platform device, as /sys/bus/platform/devices has it. */
static ssize_t stepper_folder_dev_name_show(struct config_item *item, char *page)
{
	struct stepper_folder *folder = to_folder(item);
	int n = 0;

	mutex_lock(&folder->mutex);
	if (folder->live)
		n = sysfs_emit(page, "%s\n",
			       dev_name(stepper_nodes_device(folder->live)));
	mutex_unlock(&folder->mutex);
	return n;
}
CONFIGFS_ATTR_RO(stepper_folder_, dev_name);

/* Name of the node in /dev; nothing while it is not bound. */
static ssize_t stepper_folder_cdev_show(struct config_item *item, char *page)
{
	struct stepper_folder *folder = to_folder(item);
	struct stepper *stepper;
	struct device *dev;
	int n = 0;

	mutex_lock(&folder->mutex);
	if (folder->live) {
		dev = stepper_nodes_device(folder->live);
		device_lock(dev); /* it may be unbound through sysfs */
		stepper = dev_get_drvdata(dev);
		if (stepper)
			n = sysfs_emit(page, "%s\n", dev_name(&stepper->dev));
		device_unlock(dev);
	}
	mutex_unlock(&folder->mutex);
	return n;
}
CONFIGFS_ATTR_RO(stepper_folder_, cdev);

static ssize_t stepper_folder_live_show(struct config_item *item, char *page)
{
	struct stepper_folder *folder = to_folder(item);
	bool live;

	mutex_lock(&folder->mutex);
	live = folder->live;
	mutex_unlock(&folder->mutex);
	return sysfs_emit(page, "%d\n", live);
}

static int stepper_folder_bind(struct stepper_folder *folder)
{
	struct stepper_nodes *live;
	int i, n = 0;

	for (i = 0; i < INCISE_STEPPER_MOTORS_MAX; i++)
		if (folder->motor[i] && i != n++)
			return -EINVAL; /* a gap before it */
	if (!n)
		return -EINVAL;
	folder->wires.name = config_item_name(&folder->group.cg_item);
	folder->wires.n_motors = n;
	live = stepper_nodes_make(&folder->wires);
	if (IS_ERR(live))
		return PTR_ERR(live);
	folder->live = live;
	return 0;
}

/* The first n motors' folders can be removed again. */
static void stepper_folder_unpin(struct stepper_folder *folder, int n)
{
	while (n--)
		if (folder->motor[n])
			configfs_undepend_item_unlocked(folder->motor[n]);
}

/*
 * Motors' folders, and with them this one, cannot be removed while live. A folder that is
 * just being made or removed cannot be pinned; su_mutex and folder->mutex are held, so that
 * it is at least linked to its parent, and pinned folders stay as they are.
 */
static int stepper_folder_pin(struct stepper_folder *folder)
{
	int i, ret;

	for (i = 0; i < INCISE_STEPPER_MOTORS_MAX; i++) {
		if (!folder->motor[i])
			continue;
		ret = configfs_depend_item_unlocked(&stepper_configfs, folder->motor[i]);
		if (ret) {
			stepper_folder_unpin(folder, i);
			return ret == -ENOENT ? -EBUSY : ret;
		}
	}
	return 0;
}

static ssize_t stepper_folder_live_store(struct config_item *item, const char *page,
					 size_t n)
{
	struct stepper_folder *folder = to_folder(item);
	bool live;
	int ret;

	ret = kstrtobool(page, &live);
	if (ret)
		return ret;
	/* configfs holds su_mutex when it makes and drops folders, so it comes first. */
	mutex_lock(&stepper_configfs.su_mutex);
	mutex_lock(&folder->mutex);
	if (live == !!folder->live)
		ret = -EPERM;
	else if (live)
		ret = stepper_folder_pin(folder);
	mutex_unlock(&stepper_configfs.su_mutex);
	if (ret) {
		/* Nothing was changed. */
	} else if (live) {
		ret = stepper_folder_bind(folder);
		if (ret)
			stepper_folder_unpin(folder, INCISE_STEPPER_MOTORS_MAX);
	} else {
		stepper_nodes_free(folder->live);
		folder->live = NULL;
		stepper_folder_unpin(folder, INCISE_STEPPER_MOTORS_MAX);
	}
	mutex_unlock(&folder->mutex);
	return ret ? ret : (ssize_t)n;
}
CONFIGFS_ATTR(stepper_folder_, live);

static struct configfs_attribute *stepper_folder_attrs[] = {
	&stepper_folder_attr_estop,    &stepper_folder_attr_sync,
	&stepper_folder_attr_dev_name, &stepper_folder_attr_cdev,
	&stepper_folder_attr_live,     NULL,
};

static void stepper_folder_release(struct config_item *item)
{
	struct stepper_folder *folder = to_folder(item);
	int i;

	if (folder->live)
		stepper_nodes_free(folder->live);
	for (i = 0; i < STEPPER_WIRES; i++)
		kfree(folder->wires.wire[i].label);
	mutex_destroy(&folder->mutex);
	kfree(folder);
}

static struct configfs_item_operations stepper_folder_item_ops = {
	.release = stepper_folder_release,
};

static struct configfs_group_operations stepper_folder_group_ops = {
	.make_group = stepper_motor_folder_make,
	.drop_item = stepper_motor_folder_drop,
};

static const struct config_item_type stepper_folder_type = {
	.ct_item_ops = &stepper_folder_item_ops,
	.ct_group_ops = &stepper_folder_group_ops,
	.ct_attrs = stepper_folder_attrs,
	.ct_owner = THIS_MODULE,
};

static struct config_group *stepper_folder_make(struct config_group *group,
						const char *name)
{
	struct stepper_folder *folder;

	/* info.name is to hold it. */
	if (strlen(name) >= sizeof(((struct incise_stepper_controller *)0)->name))
		return ERR_PTR(-ENAMETOOLONG);
	folder = kzalloc(sizeof(*folder), GFP_KERNEL);
	if (!folder)
		return ERR_PTR(-ENOMEM);
	mutex_init(&folder->mutex);
	config_group_init_type_name(&folder->group, name, &stepper_folder_type);
	return &folder->group;
}

static struct configfs_group_operations stepper_configfs_ops = {
	.make_group = stepper_folder_make,
};

static const struct config_item_type stepper_configfs_type = {
	.ct_group_ops = &stepper_configfs_ops,
	.ct_owner = THIS_MODULE,
};

int stepper_configfs_init(void)
{
	config_group_init_type_name(&stepper_configfs.su_group, "incise-stepper",
				    &stepper_configfs_type);
	mutex_init(&stepper_configfs.su_mutex);
	return configfs_register_subsystem(&stepper_configfs);
}

void stepper_configfs_exit(void)
{
	configfs_unregister_subsystem(&stepper_configfs);
	mutex_destroy(&stepper_configfs.su_mutex);
}
