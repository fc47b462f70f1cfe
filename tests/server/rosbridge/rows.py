"""A table of subscriptions, as it is made and as it is sent."""

from __future__ import annotations

from server.rosbridge.subscription import Subscription

SPEED = Subscription(topic="/vel", type="geometry_msgs/Twist", queue_length=50)
SCAN = Subscription(topic="/scan", type="sensor_msgs/LaserScan", compression="cbor", throttle_ms=50, queue_length=1)
ANY = Subscription(topic="/any", type=None)
ROWS = [
    {
        "op": "subscribe",
        "id": "subscribe:/vel",
        "topic": "/vel",
        "type": "geometry_msgs/Twist",
        "compression": "none",
        "throttle_rate": 1,  # never 0 with a queue
        "queue_length": 50,
    },
    {
        "op": "subscribe",
        "id": "subscribe:/scan",
        "topic": "/scan",
        "type": "sensor_msgs/LaserScan",
        "compression": "cbor",
        "throttle_rate": 50,
        "queue_length": 1,
    },
    {
        "op": "subscribe",
        "id": "subscribe:/any",
        "topic": "/any",
        "compression": "none",
        "throttle_rate": 0,
        "queue_length": 0,
    },
]
OVER = {"op": "unsubscribe", "id": "over", "topic": "/over"}
